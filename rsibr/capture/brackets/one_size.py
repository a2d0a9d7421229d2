"""Check that photographs of one view have one size."""

from __future__ import annotations

from collections.abc import Sequence

from rsibr.capture.photographs.photograph import Photograph
from rsibr.errors import InputError


def check_one_size(photographs: Sequence[Photograph]) -> None:
    """Raise an InputError that names the first photograph whose size differs from that of the first."""
    for one in photographs[1:]:
        if one.size != photographs[0].size:
            (width, height), (first_width, first_height) = one.size, photographs[0].size
            what = f"has {width} × {height} pixels, the first photograph {first_width} × {first_height}"
            raise InputError(what, where=one.name, fix="give photographs of one size")

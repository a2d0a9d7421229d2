"""Curve that a user names: one of the registered ones, or a file."""

from __future__ import annotations

from pathlib import Path

from rsibr.capture.curves.curve import Curve, curve_named, curve_names
from rsibr.capture.curves.curve_file import read_curve


def chosen_curve(curve: str | Path | Curve) -> Curve:
    """Curve of a name or a file; a curve is returned as it is.

    Raises
    ------
    InputError
        If there is neither a curve of this name nor such a file.
    """
    if isinstance(curve, Curve):
        return curve
    if str(curve) not in curve_names() and (Path(curve).suffix or Path(curve).exists()):
        return read_curve(curve)
    return curve_named(str(curve))

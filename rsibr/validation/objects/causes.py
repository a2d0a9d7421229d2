"""How much of a picture's error each cause has: reconstruction, perspective, visibility, bounces, antialiasing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.store.noise import COVERED
from rsibr.validation.estimate import Estimate
from rsibr.validation.metrics import relative_mse_of_samples
from rsibr.validation.reference import Reference


@dataclass(frozen=True)
class Cause:
    """One cause of error, measured between two truths that differ in it alone.

    Attributes
    ----------
    name : str
        Name.
    rel_mse : Estimate
        RelMSE that the cause alone makes; the noise of both truths is subtracted.
    of : str
        What was compared.
    """

    name: str
    rel_mse: Estimate
    of: str


@dataclass(frozen=True, eq=False)
class Truths:
    """Truths of one picture.

    Attributes
    ----------
    open, one_map, shadowed, full, all_over : Reference
        See `rsibr.validation.objects.truths.ObjectTruths`.
    bent : ndarray, shape (H, W)
        Share of each pixel's rays whose shading normal was bent to the horizon.
    """

    open: Reference
    one_map: Reference
    shadowed: Reference
    full: Reference
    all_over: Reference
    bent: NDArray[np.float32]

    @property
    def named(self) -> dict[str, Reference]:
        """References by name."""
        return {name: value for name, value in vars(self).items() if isinstance(value, Reference)}


def causes_of(truths: Truths) -> list[Cause]:
    """Measure each cause that does not depend on the method; that of reconstruction is the error against `open`."""
    judged = truths.open.coverage >= COVERED
    return list(_causes(truths, judged))


def _causes(t: Truths, judged: NDArray[np.bool_]) -> Iterator[Cause]:
    bent = judged & (t.bent > 0)
    plain = judged & ~bent
    yield Cause("perspective", _between(t.one_map, t.open, judged), "one exact map of the central view, against (a)")
    yield Cause("visibility", _between(t.open, t.shadowed, plain), "(a) against (b), where no normal was bent")
    yield Cause("bounces", _between(t.shadowed, t.full, judged), "(b) against (c)")
    yield Cause("visibility and bounces", _between(t.open, t.full, plain), "(a) against (c), where no normal was bent")
    yield Cause("antialiasing", _between(t.all_over, t.open, judged), "(a) over the whole square, against (a)")
    if bent.any():
        yield Cause("bent normals", _between(t.open, t.shadowed, bent), "(a) against (b) at bent normals alone")


def _between(samples: Reference, truth: Reference, pixels: NDArray[np.bool_]) -> Estimate:
    a, b = (reference.buffers[:, pixels].astype(np.float64) for reference in (samples, truth))
    return relative_mse_of_samples(a, b)

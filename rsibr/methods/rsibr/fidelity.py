"""How finely the light of a model's lobes is gathered."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsibr.methods.rsibr.wide_light import POINTS


@dataclass(frozen=True)
class Fidelity:
    """How finely the light of narrow Gaussians is gathered.

    Attributes
    ----------
    resolution : int
        Texels a side of the half-vector pyramid's level 0.
    points : int
        Points of the quadrature over wide Gaussians; see `HalfVectorQuadrature.of`.
    ratio : float
        Greatest ratio of the widths of Gaussians that share a footprint; if it is infinite, all do, with three lookups.
    texels : float
        Variance of a Gaussian over that of a normal in a texel of the map, below which it has a footprint of its own.
    """

    resolution: int
    points: int
    ratio: float
    texels: float


FAST = Fidelity(resolution=96, points=POINTS, ratio=math.inf, texels=0.0)
"""For `rsibr`."""

FINE = Fidelity(resolution=192, points=320, ratio=1.6, texels=9.0)
"""For `rsibr-fine`."""

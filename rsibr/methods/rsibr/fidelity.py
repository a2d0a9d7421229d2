"""How finely the light of a model's lobes is gathered."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.rsibr.anisotropic_footprint import LookUp
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
    between_levels : bool
        Whether footprints are interpolated between two levels of the environment pyramid; otherwise the nearest is
        taken.
    texels : float
        Variance of a Gaussian over that of a normal in a texel of the map, below which it has a footprint of its own.
    """

    resolution: int
    points: int
    ratio: float
    between_levels: bool
    texels: float

    def look_up(self, environment: EnvironmentPyramid) -> LookUp:
        """Lookup of the environment in footprints."""
        return environment.blurred if self.between_levels else environment.nearest_blurred


FAST = Fidelity(resolution=96, points=POINTS, ratio=math.inf, between_levels=False, texels=0.0)
"""For `rsibr`."""

FINE = Fidelity(resolution=192, points=320, ratio=1.6, between_levels=True, texels=9.0)
"""For `rsibr-fine`."""

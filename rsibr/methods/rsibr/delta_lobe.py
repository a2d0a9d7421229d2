"""Delta lobe (perfect mirror): mean of the reflected environment over a texel of a sphere map, as in baked maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.latlong_texture import LatLongTexture
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.lobe_terms import Lobe, albedo_at_nodes
from rsibr.methods.texel_mean import sides, texel_mean

EXACT = 3.0
"""Sample points per environment texel and side, head-on, where no residual corrects the result."""

ROUGH = 1.0
"""The same where residuals of stored maps are added: a ninth of the points."""

_MOST = 64  # sample points a side of a map texel, maximum
_FEWEST = 2
_FLATTEST = 0.35  # cosine below which the number of points does not grow further


@dataclass(eq=False)
class DeltaLobe:
    """Environment as a delta lobe reflects it; docs/method.md, section 6.3.

    Attributes
    ----------
    light : LatLongTexture or EnvironmentPyramid
        Environment image; of a pyramid the finest level is used.
    fineness : mi.Float
        Sample points a side of a map texel, over the texel's width in radii of the disk (opaque).
    """

    light: LatLongTexture | EnvironmentPyramid
    fineness: mi.Float

    @classmethod
    def of(cls, light: Light, pyramid: EnvironmentPyramid, density: float = ROUGH) -> DeltaLobe:
        """Use the environment's own image where the bake keeps it, otherwise the finest level of the pyramid.

        Parameters
        ----------
        light, pyramid
            Environment, and its Gaussian pyramid.
        density : float
            `EXACT` or `ROUGH`. Applies to the image only; the finest level is sampled at its own texel distance.
        """
        image = pyramid if light.image is None else LatLongTexture.of(light.image, light.frame)
        return cls(image, dr.opaque(mi.Float, mirror_fineness(light, density)))

    def fetch(self, d: mi.Vector3f) -> mi.Color3f:
        """Radiance [W sr⁻¹ m⁻²] from unit directions in world coordinates."""
        if isinstance(self.light, EnvironmentPyramid):
            return self.light.fetch(d, mi.UInt32(0))
        return self.light.fetch(d)

    def mean_over_texel(
        self, n: mi.Vector3f, frame: mi.Matrix3f, spacing: mi.Float, albedo: Callable[[mi.Float], mi.Color3f]
    ) -> mi.Color3f:
        """Mean of albedo × reflected radiance over the part of a texel inside the disk.

        A texel spans 2/cos θ times its width in directions of the plane of incidence. It is sampled on a regular grid;
        a Gaussian of the same variance instead has a relMSE of 1 % where the environment has edges.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normal of any point of each texel, in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk.
        albedo : callable
            cos θ → albedo.

        Returns
        -------
        mi.Color3f
            [W sr⁻¹ m⁻²].
        """

        def seen(normal: mi.Vector3f) -> mi.Color3f:
            toward = 2 * normal.z * normal - mi.Vector3f(0, 0, 1)
            return albedo(normal.z) * self.fetch(frame @ toward)

        return texel_mean(
            n, spacing, sides(n, self.fineness * spacing, _FEWEST, _MOST, _FLATTEST), seen, "mirror_over_texel"
        )


def mirror_of(
    lobes: Sequence[Lobe], pyramid: EnvironmentPyramid, light: Light, part: LobeShape | None, density: float
) -> tuple[DeltaLobe, CosineTable] | None:
    """Delta lobe and its albedo on the device; None if there is none, or it is not `part`."""
    albedo = mirror_albedo(lobes, part)
    return None if albedo is None else (DeltaLobe.of(light, pyramid, density), CosineTable.of(albedo))


def mirror_albedo(lobes: Sequence[Lobe], part: LobeShape | None) -> NDArray[np.float64] | None:
    """Albedo of the delta lobe at the nodes of the moments, (NODES, 3); None if there is none, or it is not `part`."""
    albedos = [albedo for shape, albedo in lobes if shape.is_mirror and part in (None, shape)]
    return albedo_at_nodes(albedos[0]) if albedos else None


def mirror_fineness(light: Light, density: float) -> float:
    """Sample points a side of a map texel, over the texel's width in radii of the disk; `density` as of `DeltaLobe.of`.

    Head-on, a map texel of width s reflects an angle of 2s; texels of the octahedral image are √(4π)/R apart.
    """
    if light.image is None:
        return len(light.picture) / math.sqrt(math.pi)
    return float(density * light.image.shape[1] / math.pi)

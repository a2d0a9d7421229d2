"""The light of a narrow Gaussian of facets, seen at an angle: a streak around the mirror direction.

It is as wide as 2σ in the plane of incidence and 2σ cos θ across it, and is looked up at a few places from end to end
in a light that is blurred as much as the streak is narrow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.to_device import to_device

LookUp = Callable[["mi.Vector3f", "mi.Float"], "mi.Color3f"]
"""(direction, standard deviation of the blur [rad]) → the light; of a `EnvironmentPyramid`."""

_REACH = 2.2  # standard deviations that the lookups reach
_DENSITY = 2.0  # lookups to a ratio of the streak's axes
_MOST_LOOKUPS = 24
_OVERLAP = 0.3  # least width of a lookup over the distance to the next
_LEAST_VIEW_COSINE = 1e-3  # view angle at which the shading frame is clamped
_GRAZING = 0.02  # cosine below which a streak grows no longer
_NARROWEST = 1e-9  # a mirror at a point has no streak at all


@dataclass(frozen=True)
class ShadingFrame:
    """A surface as seen from the viewer, one a lane.

    Attributes
    ----------
    n, x, y : mi.Vector3f
        Normal; the direction along the surface toward the viewer, and across it.
    cosine, sine : mi.Float
        Of the angle between normal and viewer.
    """

    n: mi.Vector3f
    x: mi.Vector3f
    y: mi.Vector3f
    cosine: mi.Float
    sine: mi.Float

    @classmethod
    def of(cls, n: mi.Vector3f, v: mi.Vector3f) -> ShadingFrame:
        """Look at surfaces with normal `n` from `v`, both unit vectors."""
        cosine = dr.clip(dr.dot(n, v), _LEAST_VIEW_COSINE, 1)
        along = v - n * dr.dot(n, v)
        squared = dr.squared_norm(along)
        any_tangent = mi.Vector3f(mi.coordinate_system(n)[0])  # head-on every plane is one of incidence
        x = dr.select(squared > 1e-10, along * dr.rsqrt(dr.maximum(squared, 1e-10)), any_tangent)
        return cls(n, x, dr.cross(n, x), cosine, dr.sqrt(dr.maximum(1 - cosine * cosine, 0)))

    @property
    def v(self) -> mi.Vector3f:
        """The viewer in the surface's frame."""
        return mi.Vector3f(self.sine, 0, self.cosine)

    def to_world(self, w: mi.Vector3f) -> mi.Vector3f:
        """Direction in the surface's frame as one in the world."""
        return self.x * w.x + self.y * w.y + self.n * w.z


@dataclass(frozen=True)
class AnisotropicFootprint:
    """The facets of a narrow Gaussian, as a viewer sees them.

    Attributes
    ----------
    shading : ShadingFrame
        The surface.
    along, across : mi.Float
        Standard deviation of the facets' slopes in the plane of incidence, beyond what the blur of a lookup covers of
        it, and across that plane.
    """

    shading: ShadingFrame
    along: mi.Float
    across: mi.Float

    @classmethod
    def of(cls, shading: ShadingFrame, sigma: mi.Float, spacing: mi.Float) -> AnisotropicFootprint:
        """Look at a Gaussian of facets.

        Parameters
        ----------
        shading : ShadingFrame
            The surface.
        sigma : mi.Float
            Standard deviation of the facets' slopes.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk, 0 for a point: a texel sees the facets of all its
            normals, and at the rim it spans 1/cos θ as many along the plane of incidence.
        """
        cosine = dr.maximum(shading.cosine, _GRAZING)
        texel = spacing * spacing * (1 / 12)  # variance of a box
        across = dr.sqrt(sigma * sigma + texel)
        along = sigma * sigma + texel / (cosine * cosine) - dr.square(cosine * across)
        return cls(shading, dr.sqrt(dr.maximum(along, 0)), across)

    def two_taps(self, look_up: LookUp) -> mi.Color3f:
        """Mean light, looked up one standard deviation to either side of the middle.

        Notes
        -----
        The Gauss–Hermite rule of two points. A place counts by the area that the viewer sees of its facet.
        """
        light, weight = mi.Color3f(0), mi.Float(0)
        for t in (-1, 1):
            facet = dr.normalize(mi.Vector3f(t * self.along, 0, 1))
            toward = dr.dot(facet, self.shading.v)
            w = 2 * toward * facet - self.shading.v
            share = dr.select((toward > 0) & (w.z > 0), toward, 0)
            light += share * look_up(self.shading.to_world(w), self._width(facet, 0.5 * self.along))
            weight += share
        return light / dr.maximum(weight, 1e-20)

    def gather(
        self, spreads: mi.Float, colour: Callable[[mi.Vector3f], tuple[mi.Vector3f, mi.Color3f]], look_up: LookUp
    ) -> tuple[mi.Color3f, mi.Color3f]:
        """Light and weight, looked up at as many places as the streak is longer than wide.

        Parameters
        ----------
        spreads : mi.Float
            From `tap_spreads`.
        colour : callable
            Facet → the direction that it mirrors the viewer into, and its weight, both in the surface's frame.
        look_up : callable
            The light.

        Returns
        -------
        mi.Color3f, mi.Color3f
            Weighted light [W sr⁻¹ m⁻²], and the weight.
        """
        ratio = self.along / dr.maximum(dr.maximum(self.shading.cosine, _GRAZING) * self.across, _NARROWEST)
        lookups = dr.clip(dr.ceil(_DENSITY * ratio), 1, _MOST_LOOKUPS)
        step, spread = 2 * _REACH / lookups, dr.gather(mi.Float, spreads, mi.UInt32(lookups))
        least = _OVERLAP * 2 * step * self.along

        def look(
            j: mi.Float, light: mi.Color3f, weight: mi.Color3f, total: mi.Float
        ) -> tuple[mi.Float, mi.Color3f, mi.Color3f, mi.Float]:
            t = dr.fma(j + 0.5, step, -_REACH)
            facet = dr.normalize(mi.Vector3f(t * spread * self.along, 0, 1))
            share = dr.exp(-0.5 * t * t)
            w, weighing = colour(facet)
            weighing *= share
            light += weighing * look_up(self.shading.to_world(w), self._width(facet, least))
            return j + 1, light, weight + weighing, total + share

        _, light, weight, total = dr.while_loop(
            state=(mi.Float(0), dr.zeros(mi.Color3f, 1), dr.zeros(mi.Color3f, 1), mi.Float(0)),
            cond=lambda j, _light, _weight, _total: j < lookups,
            body=look,
            labels=("j", "light", "weight", "total"),
            label="lookups_along_a_streak",
        )
        scale = dr.rcp(total)
        return light * scale, weight * scale

    def _width(self, facet: mi.Vector3f, least: mi.Float) -> mi.Float:
        """Standard deviation [rad] of the blur to look the light up with: the streak's across, but not too narrow."""
        return dr.maximum(2 * dr.dot(facet, self.shading.v) * facet.z * self.across, least)


def tap_spreads() -> mi.Float:
    """For each count of lookups the factor on their places that gives them the variance of the Gaussian."""
    return to_device(mi.Float, np.array([_spread(n) for n in range(_MOST_LOOKUPS + 1)], dtype=np.float32))


def _spread(lookups: int) -> float:
    t = (np.arange(lookups) + 0.5) * 2 * _REACH / max(lookups, 1) - _REACH
    share = np.exp(-0.5 * t * t)
    return float(np.sqrt(share.sum() / (share * t * t).sum())) if lookups > 1 else 0.0

"""Anisotropic footprint of a narrow Gaussian of microfacet slopes in directions of light.

A Gaussian with standard deviation σ reflects the viewer into an ellipse around the mirror direction, with standard
deviations 2σ in the plane of incidence and 2σ cos θ across it (docs/method.md, eq. 18). It is sampled like an EWA
footprint (Heckbert 1989): a few lookups along the long axis, in an environment blurred to the width of the short axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.to_device import to_device

LookUp = Callable[["mi.Vector3f", "mi.Float"], "mi.Color3f"]
"""(direction, standard deviation of the blur [rad]) → radiance: a lookup of an `EnvironmentPyramid`."""

_REACH = 2.2  # standard deviations covered by the lookups, to either side
_DENSITY = 2.0  # lookups over the ratio of the footprint's axes
_MOST_LOOKUPS = 24
_OVERLAP = 0.3  # minimum width of a lookup over the distance to the next one
_LEAST_VIEW_COSINE = 1e-3  # view angle at which the shading frame is clamped
_GRAZING = 0.02  # cosine below which a footprint is not elongated further
_HERMITE = (-math.sqrt(3), 1 / 6), (0.0, 2 / 3), (math.sqrt(3), 1 / 6)
_LEAST_TAP = 0.5  # minimum width of one of three lookups over σ∥
_NARROWEST = 1e-9  # avoids 0/0 for a delta lobe at a point, whose footprint has no extent


@dataclass(frozen=True)
class ShadingFrame:
    """Shading frame of a surface and a view, one a lane; the viewer is (sin θ, 0, cos θ) in it.

    Attributes
    ----------
    n, x, y : mi.Vector3f
        Normal; unit tangents in the plane of incidence (toward the viewer) and across it.
    cosine, sine : mi.Float
        Cosine and sine of the angle θ between normal and viewer.
    """

    n: mi.Vector3f
    x: mi.Vector3f
    y: mi.Vector3f
    cosine: mi.Float
    sine: mi.Float

    @classmethod
    def of(cls, n: mi.Vector3f, v: mi.Vector3f) -> ShadingFrame:
        """Make the frame of surfaces with normal `n` seen from `v`, both unit vectors in world coordinates."""
        cosine = dr.clip(dr.dot(n, v), _LEAST_VIEW_COSINE, 1)
        along = v - n * dr.dot(n, v)
        squared = dr.squared_norm(along)
        any_tangent = mi.Vector3f(mi.coordinate_system(n)[0])  # head-on the plane of incidence is arbitrary
        x = dr.select(squared > 1e-10, along * dr.rsqrt(dr.maximum(squared, 1e-10)), any_tangent)
        return cls(n, x, dr.cross(n, x), cosine, dr.sqrt(dr.maximum(1 - cosine * cosine, 0)))

    @classmethod
    def in_map(cls, n: mi.Vector3f, frame: mi.Matrix3f) -> ShadingFrame:
        """Make the frame of unit normals `n` in the frame of a sphere map, columns x, y, v."""
        sine = dr.sqrt(n.x * n.x + n.y * n.y)
        outward = dr.rcp(dr.maximum(sine, 1e-6))
        cosine = dr.clip(n.z, _LEAST_VIEW_COSINE, 1)
        x, y = n.x * outward, n.y * outward  # zero head-on, where the footprint is round
        toward = frame @ mi.Vector3f(-n.z * x, -n.z * y, sine)
        return cls(frame @ n, toward, frame @ mi.Vector3f(y, -x, 0), cosine, sine)

    @property
    def v(self) -> mi.Vector3f:
        """View direction in the shading frame."""
        return mi.Vector3f(self.sine, 0, self.cosine)

    def to_world(self, w: mi.Vector3f) -> mi.Vector3f:
        """Transform a direction from the shading frame to world coordinates."""
        return self.x * w.x + self.y * w.y + self.n * w.z


@dataclass(frozen=True)
class AnisotropicFootprint:
    """Footprint of a narrow Gaussian of microfacet slopes for a viewer.

    Attributes
    ----------
    shading : ShadingFrame
        Surface and view.
    along, across : mi.Float
        Standard deviations of the slopes: σ∥ of the lookups' places in the plane of incidence, without the part that
        the blur of each lookup contributes, and σ⊥ across that plane (docs/method.md, eq. 19).
    centre : mi.Float
        Slope toward the viewer of its middle.
    """

    shading: ShadingFrame
    along: mi.Float
    across: mi.Float
    centre: mi.Float

    @classmethod
    def of(
        cls, shading: ShadingFrame, sigma: mi.Float, spacing: mi.Float, centre: mi.Float | float = 0.0
    ) -> AnisotropicFootprint:
        """Make the footprint of a Gaussian of microfacet slopes over a texel; docs/method.md, eq. 19.

        Parameters
        ----------
        shading : ShadingFrame
            Surface and view.
        sigma : mi.Float
            Standard deviation of the slopes.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk, 0 for a point. The spread of normals over a texel
            widens the footprint, by a factor of 1/cos θ more in the plane of incidence.
        centre : mi.Float or float
            Slope toward the viewer of the Gaussian's middle.
        """
        cosine = dr.maximum(shading.cosine, _GRAZING)
        texel = spacing * spacing * (1 / 12)  # variance of the texel's box filter
        across = dr.sqrt(sigma * sigma + texel)
        along = sigma * sigma + texel / (cosine * cosine) - dr.square(cosine * across)
        return cls(shading, dr.sqrt(dr.maximum(along, 0)), across, mi.Float(centre))

    def three_taps(self, look_up: LookUp) -> mi.Color3f:
        """Mean radiance of three lookups along the plane of incidence.

        Notes
        -----
        Gauss–Hermite rule of three points; each is weighted by h·v, the projected area of its microfacet
        (docs/method.md, section 7.6).
        """
        light, weight = mi.Color3f(0), mi.Float(0)
        for t, share in _HERMITE:
            facet = dr.normalize(mi.Vector3f(t * self.along, 0, 1))
            toward = dr.dot(facet, self.shading.v)
            w = 2 * toward * facet - self.shading.v
            counted = dr.select((toward > 0) & (w.z > 0), share * toward, 0)
            light += counted * look_up(self.shading.to_world(w), self._width(facet, _LEAST_TAP * self.along))
            weight += counted
        return light / dr.maximum(weight, 1e-20)

    def gather(
        self,
        spreads: mi.Float,
        colour: Callable[[mi.Vector3f], tuple[mi.Vector3f, mi.Color3f]],
        look_up: LookUp,
    ) -> tuple[mi.Color3f, mi.Color3f]:
        """Integrate radiance and weight over the footprint, with lookups in proportion to its axis ratio.

        Parameters
        ----------
        spreads : mi.Float
            Factors κ from `tap_spreads`.
        colour : callable
            Microfacet normal → reflected view direction in the shading frame, and weight (RGB).
        look_up : callable
            Lookup of the environment.

        Returns
        -------
        mi.Color3f, mi.Color3f
            Weighted radiance [W sr⁻¹ m⁻²] and weight, both divided by the sum of the Gaussian's weights.

        Notes
        -----
        docs/method.md, section 6.1.
        """
        # ---- Number and distance of the lookups, minimum blur of each ----
        ratio = self.along / dr.maximum(dr.maximum(self.shading.cosine, _GRAZING) * self.across, _NARROWEST)
        lookups = dr.clip(dr.ceil(_DENSITY * ratio), 1, _MOST_LOOKUPS)
        step, spread = 2 * _REACH / lookups, dr.gather(mi.Float, spreads, mi.UInt32(lookups))
        least = _OVERLAP * 2 * step * self.along

        # ---- One lookup: midpoint rule over ±_REACH, places scaled by κ (eq. 20) ----
        def look(
            j: mi.Float, light: mi.Color3f, weight: mi.Color3f, total: mi.Float
        ) -> tuple[mi.Float, mi.Color3f, mi.Color3f, mi.Float]:
            t = dr.fma(j + 0.5, step, -_REACH)
            facet = dr.normalize(mi.Vector3f(dr.fma(t * spread, self.along, self.centre), 0, 1))
            share = dr.exp(-0.5 * t * t)
            w, weighing = colour(facet)
            weighing *= share
            light += weighing * look_up(self.shading.to_world(w), self._width(facet, least))
            return j + 1, light, weight + weighing, total + share

        # ---- Sum, normalised by the weights of the midpoint rule ----
        _, light, weight, total = dr.while_loop(
            state=(mi.Float(0), dr.zeros(mi.Color3f, 1), dr.zeros(mi.Color3f, 1), mi.Float(0)),
            cond=lambda j, _light, _weight, _total: j < lookups,
            body=look,
            labels=("j", "light", "weight", "total"),
            label="lookups_along_a_footprint",
        )
        scale = dr.rcp(total)
        return light * scale, weight * scale

    def _width(self, facet: mi.Vector3f, least: mi.Float) -> mi.Float:
        """Standard deviation [rad] of the blur of a lookup: 2 (h·v) cos θ_h σ⊥, but at least `least`."""
        return dr.maximum(2 * dr.dot(facet, self.shading.v) * facet.z * self.across, least)


def tap_spreads() -> mi.Float:
    """Factor κ on the places of M lookups that gives the discrete rule the variance of the Gaussian, at index M.

    Notes
    -----
    docs/method.md, eq. 20.
    """
    return to_device(mi.Float, np.array([_spread(n) for n in range(_MOST_LOOKUPS + 1)], dtype=np.float32))


def _spread(lookups: int) -> float:
    t = (np.arange(lookups) + 0.5) * 2 * _REACH / max(lookups, 1) - _REACH
    share = np.exp(-0.5 * t * t)
    return float(np.sqrt(share.sum() / (share * t * t).sum())) if lookups > 1 else 0.0

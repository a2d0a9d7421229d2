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

from rsibr.geometry.resident import resident

_REACH = 2.2  # standard deviations that the lookups reach
_OVERLAP = 0.3  # least width of a lookup over the distance to the next
_LEAST_COSINE = 1e-3
_GRAZING = 0.02  # cosine below which a streak grows no longer


@dataclass(frozen=True)
class Slant:
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
    def of(cls, n: mi.Vector3f, v: mi.Vector3f) -> Slant:
        """Look at surfaces with normal `n` from `v`, both unit vectors."""
        cosine = dr.clip(dr.dot(n, v), _LEAST_COSINE, 1)
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


@dataclass(eq=False)
class Streak:
    """How to look a streak up.

    Attributes
    ----------
    spreads : mi.Float
        For each count of lookups the factor on their places that gives them the variance of the Gaussian.
    density : float
        Lookups to a ratio of the streak's axes.
    """

    spreads: mi.Float
    density: float

    @classmethod
    def prepared(cls, density: float = 2.0, most: int = 24) -> Streak:
        """Put on the device how to look a streak up, at `most` places at most."""
        return cls(resident(mi.Float, np.array([_spread(n) for n in range(most + 1)], dtype=np.float32)), density)

    def gather(
        self,
        slant: Slant,
        sigma: mi.Float,
        spacing: mi.Float,
        colour: Callable[[mi.Vector3f], tuple[mi.Vector3f, mi.Color3f]],
        look_up: Callable[[mi.Vector3f, mi.Float], mi.Color3f],
    ) -> tuple[mi.Color3f, mi.Color3f]:
        """Gather a light over a Gaussian of facets.

        Parameters
        ----------
        slant : Slant
            The surface as the viewer sees it.
        sigma : mi.Float
            Standard deviation of the facets' slopes.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk, 0 for a point: a texel sees the facets of all its
            normals, and at the rim it spans 1/cos θ as many along the plane of incidence.
        colour : callable
            Facet → the direction that it mirrors the viewer into, and its weight, both in the surface's frame.
        look_up : callable
            Direction and width of blur → the light; of a `LightStack`.

        Returns
        -------
        mi.Color3f, mi.Color3f
            Weighted light [W sr⁻¹ m⁻²], and the weight.
        """
        cosine = dr.maximum(slant.cosine, _GRAZING)
        texel = spacing * spacing * (1 / 12)  # variance of a box
        across = dr.sqrt(sigma * sigma + texel)
        # What the blur of a lookup covers along the plane of incidence is taken off
        along = dr.sqrt(dr.maximum(sigma * sigma + texel / (cosine * cosine) - dr.square(cosine * across), 0))
        lookups = dr.clip(dr.ceil(self.density * along / (cosine * across)), 1, len(self.spreads) - 1)
        step, spread = 2 * _REACH / lookups, dr.gather(mi.Float, self.spreads, mi.UInt32(lookups))
        least = _OVERLAP * 2 * step * along

        def look(
            j: mi.Float, gathered: mi.Color3f, weight: mi.Color3f, total: mi.Float
        ) -> tuple[mi.Float, mi.Color3f, mi.Color3f, mi.Float]:
            t = dr.fma(j + 0.5, step, -_REACH)
            facet = dr.normalize(mi.Vector3f(t * spread * along, 0, 1))
            share = dr.exp(-0.5 * t * t)
            w, weighing = colour(facet)
            width = dr.maximum(2 * dr.dot(facet, slant.v) * facet.z * across, least)
            weighing *= share
            gathered += weighing * look_up(slant.to_world(w), width)
            return j + 1, gathered, weight + weighing, total + share

        _, gathered, weight, total = dr.while_loop(
            state=(mi.Float(0), dr.zeros(mi.Color3f, 1), dr.zeros(mi.Color3f, 1), mi.Float(0)),
            cond=lambda j, _gathered, _weight, _total: j < lookups,
            body=look,
            labels=("j", "gathered", "weight", "total"),
            label="lookups_along_a_streak",
        )
        scale = dr.rcp(total)
        return gathered * scale, weight * scale


def _spread(lookups: int) -> float:
    t = (np.arange(lookups) + 0.5) * 2 * _REACH / max(lookups, 1) - _REACH
    share = np.exp(-0.5 * t * t)
    return float(np.sqrt(share.sum() / (share * t * t).sum())) if lookups > 1 else 0.0

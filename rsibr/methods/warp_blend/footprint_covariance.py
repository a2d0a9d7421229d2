"""How a lobe's footprint changes from one view to another, and what to do about it.

A microfacet lobe is round in half-vector space. Around the mirror direction r its kernel then has the standard
deviations 2σ in the plane of incidence and 2σ cos θ across it. The same r is seen from a stored view at another angle
and in another plane, so that a warped source carries the wrong covariance; to second order it errs by ½ ΔM : ∇∇L.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

HALF_VECTOR_VARIANCE = 0.4
"""σ²/α² of a GGX lobe in half-vector space. Its second moment diverges; 0.35 to 0.5 fits what is measured."""

MOST_TAKEN = 0.75
"""Share of the radiance that sharpening may take away at most."""


_NOISE = 1e-4


@dataclass
class MirrorFootprint:
    """Mirror direction of a destination texel, and the axes of its lobe's footprint there.

    Attributes
    ----------
    r : mi.Vector3f
        Mirror direction in the destination's frame.
    along, across : mi.Vector3f
        Unit tangents at r: in the plane of incidence, and across it.
    cosine : mi.Float
        cos θ of the destination.
    """

    r: mi.Vector3f
    along: mi.Vector3f
    across: mi.Vector3f
    cosine: mi.Float

    @classmethod
    def at(cls, n: mi.Vector3f) -> MirrorFootprint:
        """MirrorFootprint at the surface normal `n` in the destination's frame, where the viewer is +z."""
        r = mi.Vector3f(2 * n.x * n.z, 2 * n.y * n.z, 2 * n.z * n.z - 1)
        along = _tangent(r, mi.Vector3f(0, 0, 1))
        return cls(r, along, dr.cross(r, along), n.z)

    def axes_toward(self, stored_v: mi.Vector3f, stored_cosine: mi.Float) -> list[tuple[mi.Vector3f, mi.Float]]:
        """Directions in which a source's footprint is too narrow or too wide, and by how much.

        Parameters
        ----------
        stored_v : mi.Vector3f
            The stored view's direction in the destination's frame.
        stored_cosine : mi.Float
            cos θ of the source.

        Returns
        -------
        list of two (mi.Vector3f, mi.Float)
            Unit tangents e at r and eigenvalues λ of ΔM/4σ²: positive where the source is too narrow.
        """
        tangent = _tangent(self.r, stored_v)
        c, s = dr.dot(self.along, tangent), dr.dot(self.across, tangent)
        flatter = 1 - stored_cosine * stored_cosine
        m11, m12 = s * s * flatter, -c * s * flatter
        m22 = self.cosine * self.cosine - 1 + c * c * flatter
        mean, half = 0.5 * (m11 + m22), 0.5 * (m11 - m22)
        radius = dr.sqrt(half * half + m12 * m12)
        sine, cosine = dr.sincos(0.5 * dr.atan2(m12, half))
        first = cosine * self.along + sine * self.across
        second = cosine * self.across - sine * self.along
        return [(first, mean + radius), (second, mean - radius)]


def tap_angle(eigenvalue: mi.Float, alpha: mi.Float) -> mi.Float:
    """Angle [rad] from r at which two taps stand in for the second derivative: √(3·4σ²|λ|)."""
    excess = dr.maximum(dr.abs(eigenvalue) - _NOISE, 0)  # at a stored view there is nothing to mend but rounding
    return dr.sqrt(12 * HALF_VECTOR_VARIANCE * alpha * alpha * excess)


def _tangent(r: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
    """Unit tangent at r toward v; some tangent where the two are parallel and none is meant."""
    tangent = v - dr.dot(v, r) * r
    squared = dr.squared_norm(tangent)
    fallback = mi.Vector3f(1, 0, 0) - r.x * r
    return dr.select(squared > 1e-12, tangent * dr.rsqrt(dr.maximum(squared, 1e-12)), dr.normalize(fallback + 1e-6))

"""Covariance of a lobe's footprint, and its change between two views.

A microfacet lobe is isotropic over half-vectors. Around the mirror direction r its kernel has the standard deviations
2σ in the plane of incidence and 2σ cos θ across it. A stored view sees the same r at another angle and in another plane
of incidence, so a warped source has a covariance that differs by ΔM; to second order its error is ½ ΔM : ∇∇L.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

HALF_VECTOR_VARIANCE = 0.4
"""σ²/α² of a GGX lobe over half-vectors. Its second moment diverges; values of 0.35 to 0.5 fit measured lobes."""

MOST_TAKEN = 0.75
"""Maximum share of the radiance that sharpening may remove."""


_NOISE = 1e-4


@dataclass
class MirrorFootprint:
    """Mirror direction of a destination texel, and the axes of a lobe's footprint around it.

    Attributes
    ----------
    r : mi.Vector3f
        Mirror direction in the destination's frame.
    along, across : mi.Vector3f
        Unit tangents at r, in the plane of incidence and across it.
    cosine : mi.Float
        cos θ of the destination.
    """

    r: mi.Vector3f
    along: mi.Vector3f
    across: mi.Vector3f
    cosine: mi.Float

    @classmethod
    def at(cls, n: mi.Vector3f) -> MirrorFootprint:
        """Make the footprint at surface normal `n` in the destination's frame, where the viewer is +z."""
        r = mi.Vector3f(2 * n.x * n.z, 2 * n.y * n.z, 2 * n.z * n.z - 1)
        along = _tangent(r, mi.Vector3f(0, 0, 1))
        return cls(r, along, dr.cross(r, along), n.z)

    def axes_toward(self, stored_v: mi.Vector3f, stored_cosine: mi.Float) -> list[tuple[mi.Vector3f, mi.Float]]:
        """Principal axes of the difference between the footprints of destination and source.

        Parameters
        ----------
        stored_v : mi.Vector3f
            Direction of the stored view in the destination's frame.
        stored_cosine : mi.Float
            cos θ of the source.

        Returns
        -------
        list of two (mi.Vector3f, mi.Float)
            Unit tangents e at r, and eigenvalues λ of ΔM/4σ²: positive where the source is too narrow.
        """
        # ---- ΔM/4σ² in the tangents (along, across) ----
        tangent = _tangent(self.r, stored_v)
        c, s = dr.dot(self.along, tangent), dr.dot(self.across, tangent)
        flatter = 1 - stored_cosine * stored_cosine
        m11, m12 = s * s * flatter, -c * s * flatter
        m22 = self.cosine * self.cosine - 1 + c * c * flatter
        # ---- Eigenvalues and eigenvectors of the symmetric 2 × 2 matrix ----
        mean, half = 0.5 * (m11 + m22), 0.5 * (m11 - m22)
        radius = dr.sqrt(half * half + m12 * m12)
        sine, cosine = dr.sincos(0.5 * dr.atan2(m12, half))
        first = cosine * self.along + sine * self.across
        second = cosine * self.across - sine * self.along
        return [(first, mean + radius), (second, mean - radius)]


def tap_angle(eigenvalue: mi.Float, alpha: mi.Float) -> mi.Float:
    """Angle [rad] from r of the two taps that approximate the second derivative: √(3·4σ²|λ|)."""
    excess = dr.maximum(dr.abs(eigenvalue) - _NOISE, 0)  # at a stored view λ is rounding error only
    return dr.sqrt(12 * HALF_VECTOR_VARIANCE * alpha * alpha * excess)


def _tangent(r: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
    """Unit tangent at r toward v; an arbitrary tangent where the two are parallel."""
    tangent = v - dr.dot(v, r) * r
    squared = dr.squared_norm(tangent)
    fallback = mi.Vector3f(1, 0, 0) - r.x * r
    return dr.select(squared > 1e-12, tangent * dr.rsqrt(dr.maximum(squared, 1e-12)), dr.normalize(fallback + 1e-6))

"""Two-channel table of split-sum shading: directional albedo of a GGX lobe as scale and bias of its Fresnel term."""

from __future__ import annotations

from typing import Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.lobes.microfacet import schlick

Array = NDArray[np.float64]

Masking = Literal["separable", "correlated"]
"""Smith's masking and shadowing: their product, as in Mitsuba's BSDFs, or height-correlated (Heitz 2014, eq. 99)."""

_AROUND = 64  # nodes of the quadrature over visible normals, around
_PANELS, _ORDER = 16, 16  # and outward: Gauss–Legendre in panels, because grazing light ends with a kink
_LEAST = 1e-4


def dfg(cosines: Array, alphas: Array, masking: Masking = "separable") -> Array:
    """Scale A and bias B of the directional albedo of GGX with Schlick's Fresnel term: E = F₀ A + F₉₀ B.

    Parameters
    ----------
    cosines : ndarray, shape (n,)
        Cosines of the view angle.
    alphas : ndarray, shape (m,)
        Roughnesses α.
    masking : {"separable", "correlated"}
        See `Masking`.

    Returns
    -------
    ndarray, shape (m, n, 2)
        A = ∫ (1 − w) f cos θ_i dω_i and B = ∫ w f cos θ_i dω_i with w = (1 − v·h)⁵ and f without its Fresnel term.

    Notes
    -----
    Karis (2013), eq. 8 with F₉₀ = 1. Where Karis draws half vectors, this is a product quadrature over visible normals
    (Heitz 2018): the integrand is w or 1 − w times the
    shadowing alone. Error below 1e-4 from α = 1e-3 to 1.

    Examples
    --------
    >>> albedo = dfg(np.array([1.0]), np.array([1.0])).sum()
    >>> bool(abs(albedo - (1 - np.log(2))) < 1e-4)
    True
    """
    # ---- One lane for each α, cosine and node of the quadrature ----
    radius, measure = _outward()
    points = _AROUND * len(radius)
    lane = dr.arange(mi.UInt32, len(alphas) * len(cosines) * points)
    node, pair = lane % points, lane // points
    alpha, cosine, r, w = (
        dr.gather(mi.Float, to_device(mi.Float, np.asarray(table, dtype=np.float32)), index)
        for table, index in (
            (np.maximum(alphas, _LEAST), pair // len(cosines)),
            (np.maximum(cosines, _LEAST), pair % len(cosines)),
            (radius, node // _AROUND),
            (measure / _AROUND, node // _AROUND),
        )
    )
    v = mi.Vector3f(dr.sqrt(1 - cosine * cosine), 0, cosine)
    h = _visible_normal(v, alpha, r, (mi.Float(node % _AROUND) + 0.5) * (2 * np.pi / _AROUND))
    toward = dr.dot(v, h)
    light = 2 * toward * h.z - v.z
    value = dr.select(light > 0, w * _shadowing(light, v.z, alpha, masking), 0)
    graze = schlick(toward)
    sums = [dr.block_sum(value * part, points) for part in (1 - graze, graze)]
    return np.stack([np.array(one, dtype=np.float64) for one in sums], axis=-1).reshape(len(alphas), len(cosines), 2)


def _outward() -> tuple[Array, Array]:
    """Radii in the unit disk, and their weights in ∫ 2 r dr: r = sin ψ, so that the normal's height is smooth too."""
    x, weight = np.polynomial.legendre.leggauss(_ORDER)
    psi = (np.arange(_PANELS)[:, None] + (x + 1) / 2).ravel() * (np.pi / 2 / _PANELS)
    return np.sin(psi), np.tile(weight, _PANELS) * (np.pi / 4 / _PANELS) * np.sin(2 * psi)


def _visible_normal(v: mi.Vector3f, alpha: mi.Float, radius: mi.Float, turn: mi.Float) -> mi.Vector3f:
    """Visible GGX normal of a point of the unit disk; Heitz (2018), listing 1. `v` lies in the plane y = 0."""
    stretched = dr.normalize(mi.Vector3f(alpha * v.x, 0, v.z))
    s, c = dr.sincos(turn)
    p = radius * c  # across the plane of incidence
    share = 0.5 * (1 + stretched.z)
    q = dr.lerp(dr.sqrt(dr.maximum(1 - p * p, 0)), radius * s, share)
    up = dr.sqrt(dr.maximum(1 - p * p - q * q, 0))
    # Axes around the stretched view direction: y, and that at right angles to both in the plane of incidence
    x = up * stretched.x - q * stretched.z
    z = up * stretched.z + q * stretched.x
    return dr.normalize(mi.Vector3f(alpha * x, alpha * p, dr.maximum(z, 0)))


def _shadowing(cos_i: mi.Float, cos_o: mi.Float, alpha: mi.Float, masking: Masking) -> mi.Float:
    """G₂/G₁(v): Smith's shadowing of the light."""
    square = alpha * alpha
    root_i, root_o = (dr.sqrt(square + (1 - square) * c * c) for c in (cos_i, cos_o))
    if masking == "separable":
        return 2 * cos_i / (cos_i + root_i)
    return cos_i * (cos_o + root_o) / (cos_o * root_i + cos_i * root_o)

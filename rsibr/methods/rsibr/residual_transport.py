"""Residuals of the stored views, warped to a new view and weighted."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

from rsibr.methods.warp_blend.blend import Mixture
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import MirrorWarp, PointMirrorWarp

BRIGHTEST = 1.0
"""Upper bound of residual over prediction far from all stored views; it grows as 1/(1 − w) toward a stored view."""

DARKEST = 0.25
"""Lower bound of the radiance over the prediction far from all stored views; it falls to 0 toward a stored view."""

_LEAST_COSINE = 1e-6
_LEAST_TRUST = 0.02  # in residuals carried as far as from one stored view to the next
_AT_A_STORED_VIEW = 1e-4  # 1 − w below which a view counts as stored


def warped_residual(
    sources: SourceMaps,
    mixture: Mixture,
    warps: Sequence[MirrorWarp | PointMirrorWarp],
    n: mi.Vector3f,
    cosine: mi.Float,
    damped: bool = True,
) -> mi.Color3f:
    """Σ_i w_i c_i² ρ_i² R_i(p_i) / Σ_i w_i c_i² at the surface normal `n` of the new view.

    A residual R_i = (S_i − P_i)/E is weighted by w_i c_i²: the weight w_i of its view and the cosine c_i of the surface
    in that view. It is damped by ρ_i², with the overlap ρ_i = min(c_i, cos θ)/max(c_i, cos θ) of the two footprints,
    because an error of P at one angle predicts the error at another angle less, the more the two differ. At a stored
    view ρ_i = 1, and the result is the stored map for any P. See docs/method.md, eq. 33.

    Parameters
    ----------
    sources : SourceMaps
        Residuals divided by the albedo.
    mixture : Mixture
        Stored views and their weights.
    warps : sequence of MirrorWarp or PointMirrorWarp
        Warp to each of them.
    n : mi.Vector3f
        Unit normals in the coordinates of the warps.
    cosine : mi.Float
        Cosine under which the new view sees them.
    damped : bool
        Whether residuals are damped by ρ².

    Returns
    -------
    mi.Color3f
        Weighted residual divided by the albedo [W sr⁻¹ m⁻²].
    """
    residual, total = mi.Color3f(0), mi.Float(0)
    here = dr.maximum(cosine, _LEAST_COSINE)
    for stored, weight, warp in zip(mixture.views, mixture.weights, warps, strict=True):
        normal = warp.normal(n)
        there = dr.maximum(normal.z, _LEAST_COSINE)
        overlap = dr.minimum(here, there) / dr.maximum(here, there)
        trusted = weight * there * there
        damping = overlap * overlap if damped else 1
        residual += trusted * damping * sources.fetch(stored.index, mi.Point2f(normal.x, normal.y))
        total += trusted
    return residual * (1 / total)


def trusted(trust: mi.Float, mixture: Mixture) -> mi.Float:
    """Factor on a residual from the trust in it: γ^(1 − Σ w²), 1 at a stored view; docs/method.md, section 8.6.

    Parameters
    ----------
    trust : mi.Float
        Trust γ in residuals that are carried from one stored view to the next, in [0, 1].
    mixture : Mixture
        Stored views and their weights.
    """
    together = mi.Float(0)
    for weight in mixture.weights:
        together += weight * weight
    return dr.power(dr.maximum(trust, _LEAST_TRUST), dr.maximum(1 - together, 0))


def clamped(residual: mi.Color3f, predicted: mi.Color3f, mixture: Mixture) -> mi.Color3f:
    """Clamp a residual to a multiple of the prediction; docs/method.md, eq. 34.

    A texel near the rim of a stored map averages over a large part of the environment. Warped to a texel that reflects
    only a dark part of it, an unclamped residual can exceed the local radiance by 100×. At a stored view nothing is
    clamped.

    Parameters
    ----------
    residual, predicted : mi.Color3f
        Residual times albedo, and prediction P [W sr⁻¹ m⁻²].
    mixture : Mixture
        Stored views and their weights.

    Returns
    -------
    mi.Color3f
        Residual, at most `BRIGHTEST`/(1 − w) times the prediction, with the largest weight w, and at least as much as
        leaves `DARKEST` (1 − w) of it.
    """
    apart = 1 - _largest(mixture)
    upper = predicted * (BRIGHTEST / dr.maximum(apart, _AT_A_STORED_VIEW))
    lower = predicted * (DARKEST * apart - 1)
    return dr.select(apart > _AT_A_STORED_VIEW, dr.maximum(dr.minimum(residual, upper), lower), residual)


def _largest(mixture: Mixture) -> mi.Float:
    """Weight of the nearest stored view."""
    nearest = mixture.weights[0]
    for weight in mixture.weights[1:]:
        nearest = dr.maximum(nearest, weight)
    return nearest

"""What a model of the reflected light leaves unsaid at the stored views, carried to a new one."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.methods.warp_blend.blend import Mixture
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import Warp

BRIGHTEST = 1.0
"""Residual over model beyond which it is cut, halfway between stored views; the nearer one of them is, the less is."""

_LEAST_COSINE = 1e-6
_AT_A_STORED_VIEW = 1e-4  # its weight from 1


def carried(sources: SourceMaps, mixture: Mixture, warps: list[Warp], n: mi.Vector3f) -> mi.Color3f:
    """Σ_i w_i c_i² ρ_i² R_i(p_i) / Σ_i w_i c_i² at the surface normal `n` of the new view.

    A residual R_i = (S_i − P_i)/E is trusted by the cosine c_i under which its view saw the surface, and counts as far
    as the footprints of the two views overlap, ρ_i = min(c_i, c_d)/max(c_i, c_d): an error of the model at one angle
    says the less about another the more the angles differ. At a stored view nothing is left out: exact there, whatever
    the model is.

    Parameters
    ----------
    sources : SourceMaps
        Residuals over the albedo.
    mixture : Mixture
        Stored views and their weights.
    warps : list of Warp
        To each of them.
    n : mi.Vector3f
        Unit normals in the new view's frame.

    Returns
    -------
    mi.Color3f
        The residual over the albedo [W sr⁻¹ m⁻²].
    """
    residual, total = mi.Color3f(0), mi.Float(0)
    here = dr.maximum(n.z, _LEAST_COSINE)
    for stored, weight, warp in zip(mixture.views, mixture.weights, warps, strict=True):
        p, _ = warp(n)
        there = dr.maximum(dr.sqrt(dr.maximum(1 - dr.squared_norm(p), 0)), _LEAST_COSINE)
        overlap = dr.minimum(here, there) / dr.maximum(here, there)
        trusted = weight * there * there
        residual += trusted * overlap * overlap * sources.fetch(stored.index, p)
        total += trusted
    return residual * (1 / total)


def within_reach(residual: mi.Color3f, modelled: mi.Color3f, mixture: Mixture) -> mi.Color3f:
    """Keep a residual from outshining the model where that is dark.

    What a stored map shows beside its rim is spread over much of the sky; carried to a texel that sees only a dark part
    of it, what the model misses of a lamp would light it a hundredfold. At a stored view everything is kept.

    Parameters
    ----------
    residual, modelled : mi.Color3f
        What is added, and what it is added to [W sr⁻¹ m⁻²].
    mixture : Mixture
        Stored views and their weights.

    Returns
    -------
    mi.Color3f
        The residual, no brighter than `BRIGHTEST`/(1 − w) times the model, with the greatest weight w.
    """
    nearest = mixture.weights[0]
    for weight in mixture.weights[1:]:
        nearest = dr.maximum(nearest, weight)
    reach = modelled * (BRIGHTEST / dr.maximum(1 - nearest, _AT_A_STORED_VIEW))
    return dr.select(1 - nearest > _AT_A_STORED_VIEW, dr.minimum(residual, reach), residual)

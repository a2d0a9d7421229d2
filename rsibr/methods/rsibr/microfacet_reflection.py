"""Reflection of a viewer at a microfacet, with its weight in the reflection integral."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.lobes.microfacet import LEAST_COSINE, schlick, smith_denominator


def reflected(v: mi.Vector3f, facet: mi.Vector3f, alpha: mi.Float) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
    """Reflect `v` at a microfacet: direction, weight w(h) = G₂ (h·v)/(cos θ_o cos θ_h), and Schlick's (1 − h·v)⁵.

    Parameters
    ----------
    v, facet : mi.Vector3f
        Unit vectors in the shading frame.
    alpha : mi.Float
        Roughness α of the masking.

    Notes
    -----
    docs/method.md, eqs. 13 and 16. The weight is zero where the light would come from below the surface.
    """
    toward = dr.dot(facet, v)
    w = 2 * toward * facet - v
    cos_i, cos_o = dr.maximum(w.z, LEAST_COSINE), v.z
    shadowing = 2 * cos_i / smith_denominator(cos_i, cos_o, alpha)
    factor = dr.select((toward > 0) & (w.z > 0), shadowing * toward / facet.z, 0)
    return w, factor, schlick(toward)

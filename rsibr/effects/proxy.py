"""Smooth lobes of known shape, out of which a stand-in for any BRDF is fitted.

A stand-in h = Σ h_j only decides how the true BRDF is shared out among its lobes, f·h_k/Σ h_j; it need not be exact.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

LAMBERT = 0.0
"""Stands where a roughness would for the lobe that is as wide as the hemisphere."""


def ggx(wi: mi.Vector3f, wo: mi.Vector3f, alpha: mi.Float | float) -> tuple[mi.Float, mi.Float]:
    """Microfacet lobe with the GGX distribution and no Fresnel term, and the same times Schlick's grazing term.

    Parameters
    ----------
    wi, wo : mi.Vector3f
        Unit directions to the light and to the viewer in the surface's frame.
    alpha : mi.Float or float
        Roughness α = r².

    Returns
    -------
    plain, grazing : mi.Float
        BRDF times cosine of the light [sr⁻¹]: D G₂ / (4 cos θ_o), and that times (1 − h·ω_o)⁵. Any Fresnel term of
        Schlick's form is a sum of the two.

    Notes
    -----
    Walter et al. (2007), eq. 33; height-correlated masking and shadowing after Heitz (2014), eq. 99.
    """
    h = wi + wo
    h *= dr.rsqrt(dr.maximum(dr.squared_norm(h), 1e-12))  # light from straight behind has no half vector
    squared = alpha * alpha
    base = h.z * h.z * (squared - 1) + 1
    distribution = squared / (dr.pi * base * base)
    cos_i, cos_o = dr.maximum(wi.z, 1e-6), dr.maximum(wo.z, 1e-6)
    shadow_i = cos_o * dr.sqrt(squared + (1 - squared) * cos_i * cos_i)
    shadow_o = cos_i * dr.sqrt(squared + (1 - squared) * cos_o * cos_o)
    plain = distribution * cos_i / (2 * (shadow_i + shadow_o))
    graze = 1 - dr.clip(dr.dot(h, wo), 0, 1)
    return plain, plain * graze * graze * graze * graze * graze


def lambert(wi: mi.Vector3f) -> mi.Float:
    """BRDF times cosine [sr⁻¹] of a white matte surface: cos θ_i / π."""
    return dr.maximum(wi.z, 0) * dr.inv_pi


def lobe_values(wi: mi.Vector3f, wo: mi.Vector3f, alpha: float) -> tuple[mi.Float, ...]:
    """Basis functions of the lobe of roughness `alpha`: one for `LAMBERT`, two for `ggx`."""
    return (lambert(wi),) if alpha == LAMBERT else ggx(wi, wo, alpha)

"""Smooth lobes of known shape, out of which a stand-in for any BRDF is fitted.

A stand-in h = Σ h_j only decides how the true BRDF is shared out among its lobes, f·h_k/Σ h_j; it need not be exact.
The nearer it comes, the better the model that `rsibr.methods.rsibr.lobe_integral` makes of it.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

LAMBERT = 0.0
"""Stands where a roughness would for the lobe that is as wide as the hemisphere."""

COAT_IOR = 1.5
"""Index of refraction of the coat that a coated lobe lies under: that of polymers and glass."""

COATED_FROM = 0.1
"""Roughness from which on a lobe may lie under a coat; a narrower one looks the same with and without."""

PLAIN_FROM = 0.5
"""Roughness beyond which a lobe is neither coated nor has a grazing term: with one it would pass for a matte base."""


def schlick(cosine: mi.Float) -> mi.Float:
    """Schlick's grazing term (1 − cos)⁵; Schlick (1994), eq. 24."""
    graze = 1 - dr.clip(cosine, 0, 1)
    return graze * graze * graze * graze * graze


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
    return plain, plain * schlick(dr.dot(h, wo))


def coated_ggx(wi: mi.Vector3f, wo: mi.Vector3f, alpha: mi.Float | float) -> mi.Float:
    """Microfacet lobe under a smooth coat, as metal flakes in a paint are; see `ggx`.

    Returns
    -------
    mi.Float
        BRDF times cosine of the light [sr⁻¹], the transmittance of the coat relative to that head-on.

    Notes
    -----
    f = T(θ_i) T(θ_o) f'(ω_i', ω_o')/η², with the directions refracted into the coat; light reflected back and forth
    below the coat is left out.
    """
    inner_i, inner_o = refracted(wi), refracted(wo)
    below = ggx(inner_i, inner_o, alpha)[0] * dr.maximum(wi.z, 0) / (inner_i.z * COAT_IOR * COAT_IOR)
    return below * transmitted(wi.z) * transmitted(wo.z)


def refracted(w: mi.Vector3f) -> mi.Vector3f:
    """Refract a direction into the coat, on the same side of the normal."""
    x, y = w.x * (1 / COAT_IOR), w.y * (1 / COAT_IOR)
    return mi.Vector3f(x, y, dr.sqrt(dr.maximum(1 - x * x - y * y, 1e-6)))


def transmitted(cosine: mi.Float) -> mi.Float:
    """Transmittance of the coat relative to that head-on, 1 − (1 − cos)⁵."""
    return 1 - schlick(cosine)


def lambert(wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """BRDF times cosine [sr⁻¹] of a white matte surface, cos θ_i / π, and of the same under a smooth coat."""
    bare = dr.maximum(wi.z, 0) * dr.inv_pi
    return bare, bare * transmitted(wi.z) * transmitted(wo.z)


def lobe_values(
    wi: mi.Vector3f, wo: mi.Vector3f, alpha: float, device_alpha: mi.Float | None = None
) -> tuple[mi.Float, ...]:
    """Basis functions of the lobe of roughness `alpha`.

    Parameters
    ----------
    wi, wo : mi.Vector3f
        Unit directions to the light and to the viewer in the surface's frame.
    alpha : float
        Roughness, or `LAMBERT`: decides which functions there are.
    device_alpha : mi.Float, optional
        The same number, opaque to kernels.

    Returns
    -------
    tuple of mi.Float
        `LAMBERT`: bare, coated. Otherwise plain; up to `PLAIN_FROM` grazing, and from `COATED_FROM` on coated.
    """
    if alpha == LAMBERT:
        return lambert(wi, wo)
    roughness = alpha if device_alpha is None else device_alpha
    plain, grazing = ggx(wi, wo, roughness)
    if alpha > PLAIN_FROM:
        return (plain,)
    return (plain, grazing, coated_ggx(wi, wo, roughness)) if alpha >= COATED_FROM else (plain, grazing)

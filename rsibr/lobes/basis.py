"""Smooth lobes of known shape, out of which a stand-in for any BRDF is fitted.

A stand-in h = Σ h_j only decides how the true BRDF is shared out among its lobes, f·h_k/Σ h_j; it need not be exact.
The nearer it comes, the better the model that `rsibr.methods.rsibr.lobe_integral` makes of it.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.geometry.refraction import refracted
from rsibr.lobes.microfacet import LEAST_COSINE, ggx_density, schlick, smith_denominator, transmitted

LAMBERT = 0.0
"""Stands where a roughness would for the lobe that is as wide as the hemisphere."""

COAT_IOR = 1.5
"""Index of refraction of the coat that a coated lobe lies under: that of polymers and glass."""

COATED_FROM = 0.1
"""Roughness from which on a lobe may lie under a coat; a narrower one looks the same with and without."""

PLAIN_FROM = 0.5
"""Roughness beyond which a lobe is neither coated nor has a grazing term: with one it would pass for a matte base."""


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
    Walter et al. (2007), eq. 20 and 33; height-correlated masking and shadowing, Heitz (2014), eq. 99.
    """
    h = wi + wo
    h *= dr.rsqrt(dr.maximum(dr.squared_norm(h), 1e-12))  # light from straight behind has no half vector
    cos_i, cos_o = dr.maximum(wi.z, LEAST_COSINE), dr.maximum(wo.z, LEAST_COSINE)
    plain = ggx_density(h.z, alpha) * cos_i / (2 * smith_denominator(cos_i, cos_o, alpha))
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
    inner_i, inner_o = under_coat(wi), under_coat(wo)
    below = ggx(inner_i, inner_o, alpha)[0] * dr.maximum(wi.z, 0) / (inner_i.z * COAT_IOR * COAT_IOR)
    return below * transmitted(wi.z) * transmitted(wo.z)


def under_coat(w: mi.Vector3f) -> mi.Vector3f:
    """Refract a direction into the coat, on the same side of the normal."""
    x, y, height_squared = refracted(w.x, w.y, COAT_IOR)
    return mi.Vector3f(x, y, dr.sqrt(dr.maximum(height_squared, 1e-6)))


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

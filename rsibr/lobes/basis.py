"""Basis functions of proxy lobes: Lambert and GGX, bare and under a coat.

A proxy h = Σ h_j only sets the shares f·h_k/Σ h_j of the lobes in the true BRDF f, which add up to f whatever h is.
Predictions are made from the lobe's own shape (`rsibr.lobes.shape_fit`), those of delta lights from the proxies.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.geometry.refraction import refracted
from rsibr.lobes.microfacet import LEAST_COSINE, ggx_density, schlick, smith_denominator, transmitted

LAMBERT = 0.0
"""Sentinel α for a Lambertian lobe."""

COAT_IOR = 1.5
"""Index of refraction of the coat over a coated lobe: that of polymers and glass."""

COATED_FROM = 0.1
"""Least roughness α of a coated term; in narrower lobes it is indistinguishable from the plain one."""

PLAIN_FROM = 0.5
"""Roughness α above which a lobe has only its plain term; with others a fit would mistake it for a matte base."""


def ggx(wi: mi.Vector3f, wo: mi.Vector3f, alpha: mi.Float | float) -> tuple[mi.Float, mi.Float]:
    """GGX microfacet lobe without a Fresnel term, and the same times Schlick's grazing term.

    Parameters
    ----------
    wi, wo : mi.Vector3f
        Unit directions to the light and to the viewer in the surface's frame.
    alpha : mi.Float or float
        Roughness α = r².

    Returns
    -------
    plain, grazing : mi.Float
        BRDF times cosine of the light [sr⁻¹]: D G₂ / (4 cos θ_o), and that times (1 − h·ω_o)⁵. Every Fresnel term of
        Schlick's form is a linear combination of the two.

    Notes
    -----
    Walter et al. (2007), eq. 20 and 33; height-correlated masking and shadowing, Heitz (2014), eq. 99.
    """
    h = wi + wo
    h *= dr.rsqrt(dr.maximum(dr.squared_norm(h), 1e-12))  # wi = −wo has no half vector
    cos_i, cos_o = dr.maximum(wi.z, LEAST_COSINE), dr.maximum(wo.z, LEAST_COSINE)
    plain = ggx_density(h.z, alpha) * cos_i / (2 * smith_denominator(cos_i, cos_o, alpha))
    return plain, plain * schlick(dr.dot(h, wo))


def coated_ggx(wi: mi.Vector3f, wo: mi.Vector3f, alpha: mi.Float | float) -> mi.Float:
    """GGX lobe under a smooth coat, such as metal flakes in a paint.

    Parameters
    ----------
    wi, wo, alpha
        As in `ggx`.

    Returns
    -------
    mi.Float
        BRDF times cosine of the light [sr⁻¹]; the coat's transmittance is relative to that at normal incidence.

    Notes
    -----
    f = T(θ_i) T(θ_o) f'(ω_i', ω_o')/η² with the directions refracted into the coat. Interreflection below the coat is
    neglected.
    """
    inner_i, inner_o = under_coat(wi), under_coat(wo)
    below = ggx(inner_i, inner_o, alpha)[0] * dr.maximum(wi.z, 0) / (inner_i.z * COAT_IOR * COAT_IOR)
    return below * transmitted(wi.z) * transmitted(wo.z)


def under_coat(w: mi.Vector3f) -> mi.Vector3f:
    """Refract a direction into the coat, on the same side of the normal."""
    x, y, height_squared = refracted(w.x, w.y, COAT_IOR)
    return mi.Vector3f(x, y, dr.sqrt(dr.maximum(height_squared, 1e-6)))


def lambert(wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """BRDF times cosine [sr⁻¹] of a white Lambertian surface, cos θ_i / π, and of the same under a smooth coat."""
    bare = dr.maximum(wi.z, 0) * dr.inv_pi
    return bare, bare * transmitted(wi.z) * transmitted(wo.z)


def lobe_values(
    wi: mi.Vector3f, wo: mi.Vector3f, alpha: float, device_alpha: mi.Float | None = None
) -> tuple[mi.Float, ...]:
    """Evaluate the basis functions of a lobe of roughness `alpha`.

    Parameters
    ----------
    wi, wo : mi.Vector3f
        Unit directions to the light and to the viewer in the surface's frame.
    alpha : float
        Roughness, or `LAMBERT`; selects the functions.
    device_alpha : mi.Float, optional
        The same number as an opaque variable, so that all roughnesses share a kernel.

    Returns
    -------
    tuple of mi.Float
        BRDF times cosine [sr⁻¹]. For `LAMBERT` bare and coated; otherwise plain, up to `PLAIN_FROM` also grazing, and
        from there down to `COATED_FROM` also coated.
    """
    if alpha == LAMBERT:
        return lambert(wi, wo)
    roughness = alpha if device_alpha is None else device_alpha
    plain, grazing = ggx(wi, wo, roughness)
    if alpha > PLAIN_FROM:
        return (plain,)
    return (plain, grazing, coated_ggx(wi, wo, roughness)) if alpha >= COATED_FROM else (plain, grazing)

"""Terms of the GGX microfacet model, each written once for Dr.Jit and NumPy arrays."""

from __future__ import annotations

from typing import Any

import drjit as dr

LEAST_COSINE = 1e-6
"""Floor of a cosine that shadowing is divided by: keeps a direction on the horizon finite."""


def schlick(cosine: Any, xp: Any = dr) -> Any:
    """Schlick's grazing term (1 − cos θ)⁵; Schlick (1994), eq. 24.

    Parameters
    ----------
    cosine : mi.Float or ndarray
        Cosine of the angle between half vector and direction; clipped to [0, 1].
    xp : module
        `drjit` or `numpy`, whichever the arrays belong to.
    """
    graze = 1 - xp.clip(cosine, 0, 1)
    return graze * graze * graze * graze * graze


def transmitted(cosine: Any, xp: Any = dr) -> Any:
    """Transmittance of a smooth coat relative to that at normal incidence, 1 − (1 − cos θ)⁵."""
    return 1 - schlick(cosine, xp)


def ggx_density(cosine: Any, alpha: Any) -> Any:
    """Density of GGX microfacet normals [sr⁻¹], D = α² / (π (cos² θ_h (α² − 1) + 1)²).

    Parameters
    ----------
    cosine : mi.Float or ndarray
        Cosine of the angle between the microfacet's normal and the surface's.
    alpha : mi.Float or float
        Roughness α.

    Notes
    -----
    Walter et al. (2007), eq. 33.
    """
    squared = alpha * alpha
    base = cosine * cosine * (squared - 1) + 1
    return squared / (dr.pi * base * base)


def smith_denominator(cos_i: Any, cos_o: Any, alpha: Any, xp: Any = dr) -> Any:
    """Denominator S of Smith's height-correlated masking and shadowing of GGX, G₂ = 2 cos θ_i cos θ_o / S.

    S itself is handed out because the factors of G₂ cancel against those of the reflection integral.

    Parameters
    ----------
    cos_i, cos_o : mi.Float or ndarray
        Cosines of the angles to the light and to the viewer, > 0.
    alpha : mi.Float or float
        Roughness α.
    xp : module
        `drjit` or `numpy`, whichever the arrays belong to.

    Notes
    -----
    S = cos θ_o √(α² + (1 − α²) cos² θ_i) + cos θ_i √(α² + (1 − α²) cos² θ_o); Heitz (2014), eq. 99.
    """
    squared = alpha * alpha
    shadowing = cos_o * xp.sqrt(squared + (1 - squared) * cos_i * cos_i)
    masking = cos_i * xp.sqrt(squared + (1 - squared) * cos_o * cos_o)
    return shadowing + masking

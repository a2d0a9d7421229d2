"""Microfacets as a viewer sees them: the share of the light that each reflects, bare or under a coat.

Walter et al. (2007), eq. 20 and 38, in slopes; under a coat in the refracted directions, as in
`rsibr.lobes.basis.coated_ggx`. See docs/method.md, eq. 16.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.refraction import emerging, refracted
from rsibr.lobes.basis import COAT_IOR
from rsibr.lobes.microfacet import LEAST_COSINE, smith_denominator, transmitted

Array = NDArray[np.float64]

Seen = Callable[[Array, Array, float], tuple[Array, Array]]
"""(viewer, microfacets, α) → share of the light that each reflects to the viewer; equivalent microfacets outside."""


def under_coat(w: Array) -> Array:
    """Refract unit directions, shape (…, 3), into the coat, on the same side of the normal."""
    return _direction(*refracted(w[..., 0], w[..., 1], COAT_IOR))[0]


def seen_bare(viewer: Array, facet: Array, alpha: float) -> tuple[Array, Array]:
    """Share of the light that microfacets on the surface reflect to the viewer, and the microfacets.

    Parameters
    ----------
    viewer, facet : ndarray, shape (…, 3)
        Unit vectors in the surface's frame, the viewer in the plane of x and z.
    alpha : float
        Roughness α of the masking.

    Returns
    -------
    share : ndarray
        F-less weight G₂ (h·v)/(cos θ_o cos θ_h), zero for light from below the surface.
    outer : ndarray, shape (…, 3)
        The microfacets themselves.
    """
    share, _ = _reflected(viewer, facet, alpha)
    return share, np.broadcast_to(facet, (*share.shape, 3))


def seen_coated(viewer: Array, facet: Array, alpha: float) -> tuple[Array, Array]:
    """The same for microfacets under the coat; `outer` are those outside that reflect into the same directions."""
    share, light = _reflected(under_coat(viewer), facet, alpha)
    outer_light, escapes = _direction(*emerging(light[..., 0], light[..., 1], COAT_IOR))
    through = transmitted(outer_light[..., 2], np) * transmitted(viewer[..., 2], np)
    half = outer_light + viewer
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    return np.where(escapes, share * through, 0.0), half


def _reflected(viewer: Array, facet: Array, alpha: float) -> tuple[Array, Array]:
    """Share of the light that a microfacet reflects to the viewer, and the direction to that light."""
    toward = (facet * viewer).sum(axis=-1)
    light = 2 * toward[..., None] * facet - viewer
    cos_i, cos_o = np.maximum(light[..., 2], LEAST_COSINE), viewer[..., 2]
    share = 2 * cos_i * toward / (smith_denominator(cos_i, cos_o, alpha, np) * facet[..., 2])
    return np.where((toward > 0) & (light[..., 2] > 0), share, 0.0), light


def _direction(x: Array, y: Array, height_squared: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Unit direction from what `refracted` and `emerging` return, and whether it passes the interface."""
    return np.stack([x, y, np.sqrt(np.maximum(height_squared, 1e-6))], axis=-1), height_squared > 0

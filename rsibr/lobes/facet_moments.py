"""Energy, mean and standard deviation of the visible microfacet lobe, by view angle.

At an oblique angle some microfacets are masked, and some reflect below the horizon. The visible part of a Gaussian over
slopes is narrower, and its mean leans toward the viewer: the off-specular peak of the lobe. See docs/method.md, eq. 26.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.microfacet import schlick, transmitted
from rsibr.lobes.visible_facets import Seen, seen_bare, seen_coated

NODES = 33
"""View angles, uniform in √cos θ."""

Array = NDArray[np.float64]

_GRAZING_NODE = 2e-3  # cosine of the first node: at 0 every microfacet is masked
_RADII, _TURNS = 24, 24  # points of the quadrature over a Gaussian
_NARROWEST = 1e-5
_TRANSMITTED = 20 / 21  # mean of Schlick's transmittance over a cosine lobe


@dataclass(frozen=True, eq=False)
class FacetMoments:
    """Moments of one Gaussian over microfacet slopes at each view angle of `cosines`.

    Attributes
    ----------
    weight : ndarray, shape (NODES, 3)
        Energy: light reflected under a constant sky of radiance 1, in each channel.
    lean : ndarray, shape (NODES,)
        Mean tilt [rad] of the microfacets from the normal toward the viewer. The projected area h·v is divided out: the
        half-vector pyramid multiplies it in.
    width : ndarray, shape (NODES,)
        Standard deviation [rad] of the microfacet normals around the mean: geometric mean of those along and across the
        plane of incidence.
    """

    weight: Array
    lean: Array
    width: Array


def cosines() -> Array:
    """Cosines of the view angle at the nodes, shape (NODES,), from grazing to normal incidence."""
    return np.maximum(np.linspace(0, 1, NODES) ** 2, _GRAZING_NODE)


@lru_cache(maxsize=32)  # methods of one bake ask for the same shapes
def facet_moments(shape: LobeShape) -> list[FacetMoments]:
    """Moments of each Gaussian of a lobe.

    Parameters
    ----------
    shape : LobeShape
        Shape of the lobe.

    Returns
    -------
    list of FacetMoments
        Those of the bare Gaussians, then of the coated ones.

    Notes
    -----
    Quadrature over slopes of F G₂ (h·v)/(cos θ_o cos θ_h), the reflected light of a microfacet surface (Walter et al.
    2007, eq. 20 and 38, in slopes); under a coat in the refracted directions, as in `rsibr.lobes.basis.coated_ggx`.
    """
    return [
        *_moments(shape.bare, shape.alpha, seen_bare),
        *_moments(shape.coated, shape.alpha, seen_coated),
    ]


def matte_energy(matte: Array) -> Array:
    """Light that a matte lobe reflects under a constant sky of radiance 1, shape (NODES, 3).

    Parameters
    ----------
    matte : ndarray, shape (2, 3)
        Weights of the bare and of the coated cosine lobe; see `LobeShape`.

    Notes
    -----
    Under a coat T(θ_o) ∫ 2 c T(c) dc = T(θ_o) · 20/21 with Schlick's T(c) = 1 − (1 − c)⁵.
    """
    return np.asarray(matte[0] + matte[1] * _TRANSMITTED * transmitted(cosines(), np)[:, None])


def _moments(gaussians: Gaussians, alpha: float, seen: Seen) -> list[FacetMoments]:
    terms = zip(gaussians.sigmas, gaussians.plain, gaussians.grazing, strict=True)
    return [_of_one(sigma, plain, grazing, alpha, seen) for sigma, plain, grazing in terms]


def _of_one(sigma: float, plain: Array, grazing: Array, alpha: float, seen: Seen) -> FacetMoments:
    # Quadrature over the Gaussian of slopes: equal-probability rings times azimuths
    quantile = (np.arange(_RADII) + 0.5) / _RADII
    radius = max(sigma, _NARROWEST) * np.sqrt(-2 * np.log1p(-quantile))[:, None]
    turn = (np.arange(_TURNS) + 0.5) * 2 * np.pi / _TURNS
    slopes = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.ones((_RADII, _TURNS))], axis=-1)
    facet = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    # Share of each microfacet at each view angle, and its weight by projected area
    cosine = cosines()
    viewer = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=-1)[:, None, None]  # (NODES, 1, 1, 3)
    share, outer = seen(viewer, facet, alpha)
    toward = np.maximum((outer * viewer).sum(axis=-1), 1e-3)
    grazed = schlick(toward, np)
    # Energy, then mean and width
    mean = (share.mean(axis=(1, 2)), (share * grazed).mean(axis=(1, 2)))
    weight = mean[0][:, None] * plain + mean[1][:, None] * grazing
    lean, width = _middle(outer, share / toward * (plain.mean() + grazing.mean() * grazed))
    return FacetMoments(weight, lean, np.where(width > 0, width, sigma))


def _middle(facet: Array, share: Array) -> tuple[Array, Array]:
    """Mean tilt in the plane of incidence, and standard deviation, of microfacet normals [rad]."""
    lateral = np.hypot(facet[..., 0], facet[..., 1])
    angle = np.arctan2(lateral, facet[..., 2]) / np.maximum(lateral, 1e-12)
    along, across = facet[..., 0] * angle, facet[..., 1] * angle
    total = np.maximum(share.sum(axis=(1, 2)), 1e-30)

    def mean(values: Array) -> Array:
        return np.asarray((share * values).sum(axis=(1, 2)) / total)

    lean = mean(along)
    along_variance = mean((along - lean[:, None, None]) ** 2)
    return lean, np.sqrt(np.sqrt(along_variance * mean(across**2)))

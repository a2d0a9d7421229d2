"""Quadrature over the slopes of wide Gaussians, at the rings of a polar grid of normals.

At every normal of a ring the points are the same up to a rotation about the view. Each is a place in the half-vector
map and a weight; the light there is a lookup in the level of the half-vector pyramid that is as wide as the point's
share of the slopes. The tables depend on the material alone. See docs/method.md, section 6.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.refraction import refracted
from rsibr.lobes.basis import COAT_IOR
from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.microfacet import schlick
from rsibr.lobes.visible_facets import seen_bare, seen_coated
from rsibr.methods.rsibr.half_vector_pyramid import lookup_variances, texel_angle
from rsibr.methods.rsibr.lobe_terms import WIDE, GaussianTerm
from rsibr.methods.rsibr.polar_grid import RINGS

Array = NDArray[np.float64]

POINTS = 192
"""Points for the Gaussians of one lobe that lie within a factor of two in width."""

_FAINTEST = 1e-3  # share of the wide light below which a set of points is left out
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
_LEAST_COSINE = 2e-3  # of the last ring, whose normals are at right angles to the view


@dataclass(frozen=True, eq=False)
class SlopeQuadrature:
    """Points at each ring.

    Attributes
    ----------
    places : ndarray, shape (RINGS + 1, points, 2)
        Places in the half-vector map for the normal at azimuth 0.
    levels : ndarray of int, shape (RINGS + 1, points)
        Level of the half-vector pyramid.
    weights : ndarray, shape (RINGS + 1, points, 3)
        Weights; they add up to 1 in each channel of a ring.
    """

    places: Array
    levels: NDArray[np.int64]
    weights: Array

    @classmethod
    def of(cls, terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm]) -> SlopeQuadrature | None:
        """Place the points for the wide ones of `terms`, with the shares of `parts`; None if they have none.

        Parameters
        ----------
        terms, parts : sequence of GaussianTerm
            Wide Gaussians of all lobes, and the same in the same order with the shares that count: of all lobes, or of
            one.
        """
        sets = [(terms[k], parts[k]) for k in range(len(terms))]
        groups: dict[tuple[float, bool, int], list[tuple[GaussianTerm, GaussianTerm]]] = {}
        for term, part in sets:
            key = term.alpha, term.is_coated, int(np.log2(term.sigma / WIDE) + 1e-9)
            groups.setdefault(key, []).append((term, part))
        share = {key: np.sum([part.share for _, part in members], axis=0) for key, members in groups.items()}
        whole = np.sum(list(share.values()), axis=0) if share else np.zeros(1)
        if not whole.any():
            return None
        kept = [key for key in groups if share[key].sum() > _FAINTEST * whole.sum()]
        found = [_points([term for term, _ in groups[key]], share[key]) for key in kept]
        places, levels, weights = (np.concatenate(column, axis=1) for column in zip(*found, strict=True))
        return cls(places, levels, weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-30))


def _points(terms: Sequence[GaussianTerm], share: Array) -> tuple[Array, NDArray[np.int64], Array]:
    """Places, levels and weights of one set of points at all rings; the weights add up to its share."""
    slopes, area, plain, grazing = _spiral(terms)
    facet = np.stack([slopes[:, 0], slopes[:, 1], np.ones(len(slopes))], axis=1)
    facet /= np.linalg.norm(facet, axis=1, keepdims=True)
    polar = np.arange(RINGS + 1) * (0.5 * np.pi / RINGS)
    cosine = np.maximum(np.cos(polar), _LEAST_COSINE)
    sine = np.sqrt(1 - cosine**2)
    viewer = np.stack([sine, 0 * sine, cosine], axis=1)[:, None]
    # ---- Weight of each microfacet, and the equivalent one outside a coat ----
    coated = terms[0].is_coated
    seen, outer = (seen_coated if coated else seen_bare)(viewer, facet, terms[0].alpha)
    toward = np.maximum((outer * viewer).sum(axis=-1), 1e-3)
    weights = seen[..., None] * (plain + grazing * schlick(toward, np)[..., None])
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-30)
    nodes = np.sqrt(cosines())
    weights *= np.stack([np.interp(np.sqrt(cosine), nodes, channel) for channel in share.T], axis=1)[:, None]
    # ---- Place in the half-vector map of the view: shading frame → frame of the view ----
    x = -cosine[:, None] * outer[..., 0] + sine[:, None] * outer[..., 2]
    z = sine[:, None] * outer[..., 0] + cosine[:, None] * outer[..., 2]
    visible = (z > 0) & (seen > 0)
    places = np.where(visible[..., None], np.stack([x, -outer[..., 1]], axis=-1) / (1 + np.maximum(z, 0))[..., None], 0)
    # ---- Level as wide as the point: a disk of its solid angle has the radius √(Ω/π), blurred by as much ----
    angle = facet[:, 2] ** 3 * area * (_outward(viewer, outer, toward, facet) if coated else 1.0)
    width = np.sqrt(angle / np.pi) / texel_angle(np.arccos(np.clip(z, 0, 1)))
    steps = 0.5 * np.log(lookup_variances())
    levels = np.abs(np.log(np.maximum(width, 1e-9))[..., None] - steps).argmin(axis=-1)
    return places, levels, np.where(visible[..., None], weights, 0)


def _outward(viewer: Array, outer: Array, toward: Array, facet: Array) -> Array:
    """Solid angle of equivalent microfacets outside over that of microfacets under the coat.

    Both reflect into the same light: dω_i = 4 (h·v) dω_h on either side, and η² cos θ' dω' = cos θ dω through the coat.
    """
    light = np.maximum((2 * toward[..., None] * outer - viewer)[..., 2], 1e-3)
    inner_light, inner_viewer = _below(light), _below(viewer[..., 2])
    below = np.stack([viewer[..., 0] / COAT_IOR, 0 * inner_viewer, inner_viewer], axis=-1)
    inner_toward = np.maximum((facet * below).sum(axis=-1), 1e-3)
    return np.asarray(inner_toward * COAT_IOR**2 * inner_light / (light * toward))


def _below(cosine: Array) -> Array:
    """Cosine in the coat of a direction outside."""
    return np.sqrt(refracted(np.sqrt(np.maximum(1 - cosine**2, 0)), 0.0, COAT_IOR)[2])


def _spiral(terms: Sequence[GaussianTerm]) -> tuple[Array, Array, Array, Array]:
    """Slopes on a sunflower spiral, distributed like the mixture of `terms`; area of each, plain and grazing weight."""
    sigmas = np.array([term.sigma for term in terms])
    plain, grazing = (np.stack([getattr(term, name) for term in terms]) for name in ("plain", "grazing"))
    energy = np.maximum((plain + grazing).sum(axis=1), 1e-30)
    # ---- Radii at the quantiles of the mixture's radial distribution, azimuths by the golden angle ----
    radii = np.concatenate([[0.0], np.geomspace(1e-4, 8.0, 4000)])
    within = (energy * -np.expm1(-0.5 * (radii[:, None] / sigmas) ** 2)).sum(axis=1) / energy.sum()
    radius = np.interp((np.arange(POINTS) + 0.5) / POINTS * within[-1], within, radii)
    angle = np.arange(POINTS) * _GOLDEN_ANGLE
    # ---- Area of a point: 1/(M · density of the mixture) ----
    density = np.exp(-0.5 * (radius[:, None] / sigmas) ** 2) / (2 * np.pi * sigmas**2)
    area = energy.sum() / (POINTS * (density @ energy))
    slopes = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return slopes, area, density @ plain * area[:, None], density @ grazing * area[:, None]

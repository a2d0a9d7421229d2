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

from rsibr.lobes.basis import COAT_IOR
from rsibr.lobes.facet_moments import NODES, cosines
from rsibr.lobes.microfacet import schlick
from rsibr.lobes.visible_facets import seen_bare, seen_coated, under_coat
from rsibr.methods.lobe_terms import GaussianTerm, resampled
from rsibr.methods.rsibr.half_vector_pyramid import lookup_variances, texel_angle
from rsibr.methods.rsibr.polar_grid import RINGS

Array = NDArray[np.float64]

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
    def of(
        cls, terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm], resolution: int, points: int
    ) -> SlopeQuadrature | None:
        """Place the points for the wide ones of `terms`, with the shares of `parts`; None if they have none.

        Parameters
        ----------
        terms, parts : sequence of GaussianTerm
            Wide Gaussians of all lobes, and the same in the same order with the shares that count: of all lobes, or of
            one.
        resolution : int
            Texels a side of level 0 of the half-vector pyramid.
        points : int
            Points a ring if all Gaussians are bare, or all are coated; otherwise either kind has as many times the
            root of its share.
        """
        members = list(zip(terms, parts, strict=True))
        kinds = [[pair for pair in members if pair[0].is_coated == coated] for coated in (False, True)]
        # ---- Points of a kind by its energy in all lobes: those of a part are the same ----
        energies = np.array([sum(term.share.sum() for term, _ in kind) for kind in kinds])
        counted = [any(part.share.any() for _, part in kind) for kind in kinds]
        if not any(counted):
            return None
        counts = np.ceil(points * np.sqrt(energies / energies.sum())).astype(int)
        found = [
            _points(kind, int(count), resolution)
            for kind, count, counts_in in zip(kinds, counts, counted, strict=True)
            if counts_in
        ]
        places, levels, weights = (np.concatenate(column, axis=1) for column in zip(*found, strict=True))
        return cls(places, levels, weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-30))


def _points(
    members: Sequence[tuple[GaussianTerm, GaussianTerm]], count: int, resolution: int
) -> tuple[Array, NDArray[np.int64], Array]:
    """Places, levels and weights at all rings for Gaussians alike bare or coated; the weights add up to their share."""
    terms = [term for term, _ in members]
    slopes, area = _spiral(terms, count)
    facet = np.stack([slopes[:, 0], slopes[:, 1], np.ones(count)], axis=1)
    facet /= np.linalg.norm(facet, axis=1, keepdims=True)
    polar = np.arange(RINGS + 1) * (0.5 * np.pi / RINGS)
    cosine = np.maximum(np.cos(polar), _LEAST_COSINE)
    sine = np.sqrt(1 - cosine**2)
    viewer = np.stack([sine, 0 * sine, cosine], axis=1)[:, None]
    # ---- Weight of each microfacet, lobe by lobe, and the equivalent one outside a coat ----
    weights: Array = np.zeros((RINGS + 1, count, 3))
    for alpha in sorted({term.alpha for term in terms}):
        lobe = [(term, part) for term, part in members if term.alpha == alpha]
        seen, outer = (seen_coated if terms[0].is_coated else seen_bare)(viewer, facet, alpha)
        toward = np.maximum((outer * viewer).sum(axis=-1), 1e-3)
        plain, grazing = _densities([term for term, _ in lobe], slopes, area)
        found = seen[..., None] * (plain + grazing * schlick(toward, np)[..., None])
        found /= np.maximum(found.sum(axis=1, keepdims=True), 1e-30)
        share = sum((part.share for _, part in lobe), start=np.zeros((NODES, 3)))
        weights += found * resampled(share, cosines(), cosine)[:, None]
    # ---- Place in the half-vector map of the view: shading frame → frame of the view ----
    x = -cosine[:, None] * outer[..., 0] + sine[:, None] * outer[..., 2]
    z = sine[:, None] * outer[..., 0] + cosine[:, None] * outer[..., 2]
    visible = (z > 0) & weights.any(axis=-1)
    places = np.where(visible[..., None], np.stack([x, -outer[..., 1]], axis=-1) / (1 + np.maximum(z, 0))[..., None], 0)
    # ---- Level as wide as the point: a disk of its solid angle has the radius √(Ω/π), blurred by as much (eq. 21) ----
    angle = facet[:, 2] ** 3 * area * (_outward(viewer, outer, toward, facet) if terms[0].is_coated else 1.0)
    width = np.sqrt(angle / np.pi) / texel_angle(resolution, np.arccos(np.clip(z, 0, 1)))
    steps = 0.5 * np.log(lookup_variances())
    levels = np.abs(np.log(np.maximum(width, 1e-9))[..., None] - steps).argmin(axis=-1)
    return places, levels, np.where(visible[..., None], weights, 0)


def _outward(viewer: Array, outer: Array, toward: Array, facet: Array) -> Array:
    """Solid angle of equivalent microfacets outside over that of microfacets under the coat.

    Both reflect into the same light: dω_i = 4 (h·v) dω_h on either side, and η² cos θ' dω' = cos θ dω through the coat.
    """
    light = np.maximum((2 * toward[..., None] * outer - viewer)[..., 2], 1e-3)
    inner_light = np.sqrt(1 - (1 - light**2) / COAT_IOR**2)  # Snell's law
    inner_toward = np.maximum((facet * under_coat(viewer)).sum(axis=-1), 1e-3)
    return np.asarray(inner_toward * COAT_IOR**2 * inner_light / (light * toward))


def _spiral(terms: Sequence[GaussianTerm], count: int) -> tuple[Array, Array]:
    """Slopes on a sunflower spiral, distributed like the mixture of `terms`, and the area that each stands for."""
    sigmas = np.array([term.sigma for term in terms])
    energy = np.maximum(np.array([term.share.sum() for term in terms]), 1e-30)
    # ---- Radii at the quantiles of the mixture's radial distribution, azimuths by the golden angle ----
    radii = np.concatenate([[0.0], np.geomspace(1e-4, 8.0, 4000)])
    within = (energy * -np.expm1(-0.5 * (radii[:, None] / sigmas) ** 2)).sum(axis=1) / energy.sum()
    radius = np.interp((np.arange(count) + 0.5) / count * within[-1], within, radii)
    angle = np.arange(count) * _GOLDEN_ANGLE
    # ---- Area of a point: 1/(M · density of the mixture) ----
    density = np.exp(-0.5 * (radius[:, None] / sigmas) ** 2) / (2 * np.pi * sigmas**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), energy.sum() / (count * density @ energy)


def _densities(terms: Sequence[GaussianTerm], slopes: Array, area: Array) -> tuple[Array, Array]:
    """Plain and grazing weight of each point, shape (points, 3): density of the Gaussians times area."""
    sigmas = np.array([term.sigma for term in terms])
    squared = (slopes**2).sum(axis=1)
    density = np.exp(-0.5 * squared[:, None] / sigmas**2) / (2 * np.pi * sigmas**2) * area[:, None]
    return density @ np.stack([term.plain for term in terms]), density @ np.stack([term.grazing for term in terms])

"""Quadrature over the half-vectors of wide Gaussians, at the rings of a polar grid of normals.

At every normal of a ring the points are the same up to a rotation about the view. Each is a place in the half-vector
map, a level of the half-vector pyramid, and a weight: a lookup there is a round blob of half-vectors, and the weights
are those with which all blobs of a ring add up to the kernel. The tables depend on the material alone. See
docs/method.md, section 6.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.microfacet import schlick
from rsibr.lobes.shape_fit import coated_gaussian, gaussian
from rsibr.methods.lobe_terms import GaussianTerm, resampled
from rsibr.methods.rsibr.half_vector_pyramid import lookup_variances
from rsibr.methods.rsibr.polar_grid import RINGS

Array = NDArray[np.float64]

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
_LEAST_COSINE = 2e-3  # of the last ring, whose normals are at right angles to the view
_OVERLAP = 0.65  # standard deviation of a blob over the root of the solid angle that it stands for
_SAMPLES = 4  # half-vectors at which kernel and blobs are compared, over the number of blobs
_EVEN = 0.25  # share of these that is spread evenly over the hemisphere
_ROUNDS = 24  # of the iteration for the weights
_MOST_UNSEEN = 8  # points that are placed for one that is seen, at most
_FARTHEST = 8.0  # slope of the outermost points


@dataclass(frozen=True, eq=False)
class HalfVectorQuadrature:
    """Points at each ring.

    Attributes
    ----------
    places : ndarray, shape (RINGS + 1, points, 2)
        Places in the half-vector map for the normal at azimuth 0.
    levels : ndarray of int, shape (RINGS + 1, points)
        Level of the half-vector pyramid.
    weights : ndarray, shape (RINGS + 1, points, 3)
        Weights, ≥ 0; they add up to 1 in each channel of a ring.
    """

    places: Array
    levels: NDArray[np.int64]
    weights: Array

    @classmethod
    def of(
        cls, terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm], resolution: int, points: int
    ) -> HalfVectorQuadrature | None:
        """Place the points for the wide ones of `terms`, with the shares of `parts`; None if they have none.

        Parameters
        ----------
        terms, parts : sequence of GaussianTerm
            Wide Gaussians of all lobes, and the same in the same order with the shares that count: of all lobes, or of
            one.
        resolution : int
            Texels a side of level 0 of the half-vector pyramid.
        points : int
            Points a ring.
        """
        if not any(part.share.any() for part in parts):
            return None
        polar = np.arange(RINGS + 1) * (0.5 * np.pi / RINGS)
        rings = [_ring(terms, parts, float(np.cos(angle)), resolution, points) for angle in polar]
        places, levels, weights = (np.stack(column) for column in zip(*rings, strict=True))
        return cls(places, levels, weights)


def _ring(
    terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm], cosine: float, resolution: int, points: int
) -> tuple[Array, NDArray[np.int64], Array]:
    """Places, levels and weights at one ring."""
    cosine = max(cosine, _LEAST_COSINE)
    spread = _Spread.of(terms, cosine)
    middles, samples = spread.seen(points, 0.0), spread.seen(_SAMPLES * points, _EVEN)
    # ---- Blobs as wide as they are far apart: the nearest level of the pyramid ----
    wanted = _OVERLAP * np.sqrt(middles.solid_angle) / middles.angle_per_length * (0.5 * resolution)
    steps = 0.5 * np.log(lookup_variances())
    levels = np.abs(np.log(np.maximum(wanted, 1e-9))[:, None] - steps).argmin(axis=1)
    width = np.exp(steps)[levels] * (2 / resolution)
    # ---- Weights with which they add up to the kernel ----
    blobs = _blobs(middles.places, width, samples)
    weights = np.zeros((len(middles.places), 3))
    for alpha in sorted({term.alpha for term in terms}):  # lobes apart: the parts of all add up to the whole
        lobe = [(term, part) for term, part in zip(terms, parts, strict=True) if term.alpha == alpha]
        kernel, first = (_kernel([term for term, _ in lobe], at, cosine) for at in (samples, middles))
        found = _weights(blobs, kernel, samples.solid_angle, first)
        share = resampled(np.sum([part.share for _, part in lobe], axis=0), cosines(), np.array([cosine]))
        weights += found / np.maximum(found.sum(axis=0), 1e-30) * share
    unused = points - len(weights)
    return (
        np.pad(middles.places, ((0, unused), (0, 0))),
        np.pad(levels, (0, unused)),
        np.pad(weights / np.maximum(weights.sum(axis=0), 1e-30), ((0, unused), (0, 0))),
    )


@dataclass(frozen=True, eq=False)
class _HalfVectors:
    """Half-vectors that reflect light from above the surface.

    Attributes
    ----------
    light : ndarray, shape (n, 3)
        Directions to the light in the shading frame.
    toward : ndarray, shape (n,)
        h·v.
    places : ndarray, shape (n, 2)
        In the half-vector map.
    solid_angle : ndarray, shape (n,)
        Solid angle of half-vectors [sr] that each stands for.
    """

    light: Array
    toward: Array
    places: Array
    solid_angle: Array

    @property
    def angle_per_length(self) -> Array:
        """Angle [rad] over length in the half-vector map."""
        return np.asarray(2 / (1 + (self.places**2).sum(axis=1)))


@dataclass(frozen=True, eq=False)
class _Spread:
    """How half-vectors are spread over the slopes seen by one viewer.

    Attributes
    ----------
    viewer : ndarray, shape (3,)
        In the shading frame.
    radii, root : ndarray
        Slopes, and the root of the density of the kernel's distribution there.
    """

    viewer: Array
    radii: Array
    root: Array

    @classmethod
    def of(cls, terms: Sequence[GaussianTerm], cosine: float) -> _Spread:
        """Spread for the terms, at the angle between normal and viewer."""
        place = np.sqrt(cosines())

        def at(values: Array) -> float:
            return float(np.interp(np.sqrt(cosine), place, values))

        widths = [
            at(np.hypot(term.moments.width, term.moments.lean)) if term.is_coated else term.sigma for term in terms
        ]
        sigmas, energy = np.array(widths), np.array([at(term.share.sum(axis=1)) for term in terms])
        radii = np.concatenate([[0.0], np.geomspace(1e-4, _FARTHEST, 3000)])
        density = np.exp(-0.5 * (radii[:, None] / sigmas) ** 2) / sigmas**2 @ np.maximum(energy, 1e-30)
        return cls(np.array([np.sqrt(1 - cosine**2), 0.0, cosine]), radii, np.sqrt(density))

    def seen(self, count: int, even: float) -> _HalfVectors:
        """About `count` half-vectors, no more, that reflect light from above the surface."""
        placed = count
        for _ in range(2):
            found = self._placed(min(placed, _MOST_UNSEEN * count), even)
            placed = int(placed * count / max(len(found.light), 1))
        return _HalfVectors(found.light[:count], found.toward[:count], found.places[:count], found.solid_angle[:count])

    def _placed(self, count: int, even: float) -> _HalfVectors:
        # ---- Sunflower spiral: radii at the quantiles of the density, azimuths by the golden angle ----
        middle = 0.5 * (self.radii[1:] + self.radii[:-1])
        density = np.interp(middle, self.radii, self.root)
        ring = np.pi * (self.radii[1:] ** 2 - self.radii[:-1] ** 2)
        density = (1 - even) * density / (density @ ring)
        evenly = 1 / (2 * np.pi * (1 + middle**2) ** 1.5)  # of slopes, even over the hemisphere
        density += even * evenly / (evenly @ ring)
        within = np.concatenate([[0.0], np.cumsum(density * ring)])
        radius = np.interp((np.arange(count) + 0.5) / count * within[-1], within, self.radii)
        azimuth = np.arange(count) * _GOLDEN_ANGLE
        facet = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.ones(count)], axis=1)
        facet /= np.linalg.norm(facet, axis=1, keepdims=True)
        solid_angle = facet[:, 2] ** 3 / (count * np.interp(radius, middle, density))
        # ---- What is seen: shading frame → frame of the view ----
        toward = facet @ self.viewer
        light = 2 * toward[:, None] * facet - self.viewer
        kept = (toward > 1e-4) & (light[:, 2] > 0)
        facet, toward = facet[kept], toward[kept]
        x = -self.viewer[2] * facet[:, 0] + self.viewer[0] * facet[:, 2]
        places = np.stack([x, -facet[:, 1]], axis=1) / (1 + toward)[:, None]
        return _HalfVectors(light[kept], toward, places, solid_angle[kept])


def _kernel(terms: Sequence[GaussianTerm], at: _HalfVectors, cosine: float) -> Array:
    """Density over half-vectors of the kernel of all terms of a lobe, shape (n, 3)."""
    viewer = np.broadcast_to([np.sqrt(1 - cosine**2), 0.0, cosine], at.light.shape)
    total = np.zeros((len(at.light), 3))
    for term in terms:
        value = (coated_gaussian if term.is_coated else gaussian)(at.light, viewer, term.sigma, term.alpha)[0]
        total += value[:, None] * (term.plain + term.grazing * schlick(at.toward, np)[:, None])
    return total * (4 * at.toward)[:, None]


def _blobs(middles: Array, width: Array, at: _HalfVectors) -> NDArray[np.float32]:
    """Density over half-vectors of what each lookup shows, shape (n, points): a Gaussian in the map times h·v."""
    across, along = (np.subtract.outer(at.places[:, k], middles[:, k]).astype(np.float32) for k in range(2))
    sharpness = (-0.5 / width**2).astype(np.float32)
    scale = 1 / (2 * np.pi * width**2 * _mean_height(middles, width))
    of_sample = (at.toward / at.angle_per_length**2).astype(np.float32)
    blobs = np.exp((across**2 + along**2) * sharpness) * of_sample[:, None] * scale.astype(np.float32)
    return np.asarray(blobs, dtype=np.float32)


def _mean_height(middles: Array, width: Array) -> Array:
    """Mean of h·v over a Gaussian in the half-vector map, shape (points,)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(7)
    across, along = (grid.ravel() for grid in np.meshgrid(nodes, nodes))
    places = middles[:, None] + width[:, None, None] * np.stack([across, along], axis=-1)
    squared = (places**2).sum(axis=-1)
    height = np.maximum(1 - squared, 0) / (1 + squared)
    product = np.outer(weights, weights).ravel()
    return np.asarray(np.maximum(height @ product / product.sum(), 1e-6))


def _weights(blobs: NDArray[np.float32], kernel: Array, solid_angle: Array, first: Array) -> Array:
    """Non-negative weights with which blobs add up to the kernel, shape (points, 3).

    Iteration of Richardson (1972) and Lucy (1974), from weights that are like the kernel.
    """
    scale = np.maximum(kernel.max(axis=0, initial=0.0), 1e-30)  # float32 must hold the faintest values
    weights = np.maximum(first / scale, 1e-6).astype(np.float32)
    reach = np.maximum(solid_angle.astype(np.float32) @ blobs, 1e-20)[:, None]
    wanted = (solid_angle[:, None] * kernel / scale).astype(np.float32)
    for _ in range(_ROUNDS):
        weights = weights * (blobs.T @ (wanted / np.maximum(blobs @ weights, 1e-20))) / reach
    return np.asarray(weights * scale, dtype=np.float64)

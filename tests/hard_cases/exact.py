"""Weights and depths in float64 with NumPy, for the float32 queries as they are: what the kernels should have got."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsibr.geometry.spherical import area_weights, gnomonic_weights
from tests.arrays import to_numpy, vector

WEIGHTS = {"area": area_weights, "gnomonic": gnomonic_weights}


def as_float32(rows):
    """Round to the numbers that the device gets, and keep them as float64."""
    return np.asarray(rows).astype(np.float32).astype(np.float64)


def normalised(rows):
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def side_distances(v, corners):
    """Signed distances (n, 3) of v (n, 3) to the sides of triangles (n, 3, 3); the first is the side opposite a."""
    sides = []
    for k in range(3):
        p, q = corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        sides.append(np.einsum("ij,ij->i", v, normalised(np.cross(p, q))))
    return np.stack(sides, axis=1)


def exact_weights(kind, v, corners):
    """Weights (3, n) of v (n, 3) in triangles (n, 3, 3)."""

    def measure(p, q):
        volume = np.einsum("ij,ij->i", v, np.cross(p - v, q - v))
        if kind == "gnomonic":
            return volume
        return 2 * np.arctan2(volume, 1 + (v * p).sum(1) + (p * q).sum(1) + (q * v).sum(1))

    a, b, c = np.moveaxis(corners, 1, 0)
    weights = np.stack([measure(b, c), measure(c, a), measure(a, b)])
    return weights / weights.sum(axis=0)


@dataclass
class Query:
    """Directions looked up on the device: the triangles found, their float32 corners and the weights."""

    v: np.ndarray
    triangle: np.ndarray
    corners: np.ndarray
    weights: np.ndarray

    @property
    def per_view(self):
        """Which view each weight belongs to, (3, n)."""
        return self.triangle.T


def query(views, v, kind):
    """Locate directions (n, 3) and weigh them, as a reconstruction does."""
    lanes = vector(v)
    index = views.surrounding(lanes)
    corners = [views.direction(i) for i in index]
    return Query(
        v=as_float32(v),
        triangle=np.array(index).T.astype(np.int64),
        corners=np.stack([to_numpy(corner).T for corner in corners], axis=1),
        weights=to_numpy(WEIGHTS[kind](lanes, *corners)),
    )


def edges(views):
    """Every edge once: indices of its two views, (n, 2)."""
    sides = np.concatenate([views.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    return np.unique(np.sort(sides, axis=1), axis=0)


def edge_points(views, rng):
    """A point on every edge, float64, and the edge's two views."""
    ends = edges(views)
    share = rng.uniform(0.02, 0.98, (len(ends), 1))
    return normalised(share * views.directions[ends[:, 0]] + (1 - share) * views.directions[ends[:, 1]]), ends

"""Rotation by which a view would agree best with the others, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from rsibr.validation.health.photographs.exposures import LEAST_VIEWS, SOFT, robust_mean, robust_scale
from rsibr.validation.health.photographs.observed import Observed
from rsibr.validation.health.photographs.sphere_grid import grids

Array = NDArray[np.float64]

_ROUNDS = 6
_STEP = np.radians(1.5)
_LARGEST_STEP = np.radians(3.0)
_BLOCKS = 24  # parts of the sphere that are left out in turn
_LEAST_PLACES = 200


@dataclass(frozen=True)
class Agreement:
    """How a view agrees with the others.

    Attributes
    ----------
    degrees : float
        Rotation about the sphere's centre that would make it agree best.
    error : float
        Standard error of it [degrees], from parts of the sphere left out in turn: what the model does not hold counts.
    correlation : float
        Of the view, unrotated, with what the others show.
    """

    degrees: float
    error: float
    correlation: float


def of_the_others(seen: Observed, view: int) -> tuple[Array, NDArray[np.bool_]]:
    """Field that all views but one share, and where at least three of them show it."""
    others = np.arange(len(seen.values)) != view
    known = seen.known[others]
    values = np.where(known, seen.values[others], np.nan)
    middle = robust_mean(values, np.inf)
    scale = robust_scale((values - middle)[known])
    return robust_mean(values, scale), known.sum(axis=0) >= LEAST_VIEWS


def correlation(a: Array, b: Array, weights: Array) -> float:
    """Weighted correlation of two fields; 0 if one is constant or there are too few places."""
    if len(a) < _LEAST_PLACES:
        return 0.0
    a, b = (part - np.average(part, weights=weights) for part in (a, b))
    size = float(np.sqrt((weights * a * a).sum() * (weights * b * b).sum()))
    return float((weights * a * b).sum()) / size if size > 0 else 0.0


def registered(seen: Observed, view: int) -> Agreement:
    """Find the rotation, by Gauss–Newton with Cauchy's weights from none on."""
    grid = grids()[0]
    field, shown = of_the_others(seen, view)
    use = seen.known[view] & shown
    places, values, areas = grid.directions[use], seen.values[view, use], grid.areas[use]
    alike = correlation(values, field[use], areas)
    if use.sum() < _LEAST_PLACES:
        return Agreement(0.0, np.inf, alike)
    inside = shown.astype(np.float64)
    rotation, blocks = Rotation.identity(), _blocks(places)
    for _ in range(_ROUNDS):
        turned = rotation.apply(places)
        rest = values - grid.lookup(field, turned)
        slopes = np.stack([_slope(field, turned, axis) for axis in np.eye(3)] + [np.ones(len(places))], axis=1)
        there = grid.lookup(inside, turned) > 0.99
        rest = rest - np.median(rest)
        weights = areas * there / (1 + (rest / (SOFT * robust_scale(rest[there]))) ** 2)
        step = _solve(*_normal_equations(slopes, rest, weights))[:3]
        size = float(np.linalg.norm(step))
        rotation = Rotation.from_rotvec(step * min(1.0, _LARGEST_STEP / max(size, 1e-12))) * rotation
    spread = _jackknife(slopes, rest, weights, blocks)
    vector = rotation.as_rotvec()
    size = float(np.linalg.norm(vector))
    along = vector / max(size, 1e-12)
    error = float(np.sqrt(along @ spread @ along))
    return Agreement(float(np.degrees(size)), float(np.degrees(error)), alike)


def _slope(field: Array, places: Array, axis: Array) -> Array:
    grid = grids()[0]
    ahead, behind = (grid.lookup(field, Rotation.from_rotvec(s * _STEP * axis).apply(places)) for s in (1, -1))
    return np.asarray((ahead - behind) / (2 * _STEP))


def _normal_equations(slopes: Array, rest: Array, weights: Array) -> tuple[Array, Array]:
    weighted = slopes * weights[:, None]
    return weighted.T @ slopes, weighted.T @ rest


def _solve(matrix: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix + (1e-9 * np.trace(matrix) + 1e-30) * np.eye(len(matrix)), right))


def _jackknife(slopes: Array, rest: Array, weights: Array, blocks: NDArray[np.int64]) -> Array:
    """Covariance of the rotation from its changes as blocks are left out."""
    parts = [_normal_equations(slopes[blocks == b], rest[blocks == b], weights[blocks == b]) for b in np.unique(blocks)]
    matrix, right = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
    left_out = np.array([_solve(matrix - m, right - r)[:3] for m, r in parts])
    off = left_out - left_out.mean(axis=0)
    count = len(parts)
    return np.asarray((count - 1) / count * off.T @ off)


def _blocks(places: Array) -> NDArray[np.int64]:
    """Parts of the sphere of equal size: the nearest of points on a spiral."""
    k = np.arange(_BLOCKS) + 0.5
    up, turn = 1 - 2 * k / _BLOCKS, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - up**2)
    spiral = np.stack([across * np.cos(turn), up, across * np.sin(turn)], axis=1)
    return np.asarray(cKDTree(spiral).query(places)[1])

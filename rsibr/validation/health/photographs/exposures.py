"""Exposure of each view against the others, by robust regression.

The logarithm of the radiance of view i in the common direction k is

    Y_ik = g_i + G_k + a(cos θ_ik) + E(n_ik) / e^G_k

with the exposure g_i, the field G that all views share, a profile a by angle (Fresnel), and what depends on the normal
alone (a matte base), to first order, as spherical harmonics of degree 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.validation.health.photographs.observed import Common, Observed
from rsibr.validation.health.photographs.sphere_grid import grids

Array = NDArray[np.float64]

SOFT = 2.0
"""Deviation, in robust standard deviations, at which the weight of an observation is halved: Cauchy's."""

LEAST_VIEWS = 3
"""Views that must show a direction before it counts."""

_ROUNDS = 8
_RIDGE = 1e-3
_NORMAL = 1.4826  # standard deviation over median absolute deviation


def exposures(seen: Observed, common: Common) -> Array:
    """Exposure of each view relative to the median one [stops], shape (V,)."""
    count, areas = len(seen.values), grids()[0].areas
    known = seen.known & (seen.known.sum(axis=0) >= LEAST_VIEWS)
    gains, explained, scale = np.zeros(count), np.zeros_like(seen.values), np.inf
    for _ in range(_ROUNDS):
        field = robust_mean(np.where(known, seen.values - gains[:, None] - explained, np.nan), scale)
        basis = np.where(known[..., None], _basis(seen, field, common), 0)
        target = np.where(known, seen.values - field, 0)
        rest = target - gains[:, None] - explained
        scale = robust_scale(rest[known])
        weights = np.where(known, areas / (1 + (rest / (SOFT * scale)) ** 2), 0)
        gains, coefficients = _solved(basis, target, weights)
        gains, explained = gains - np.median(gains), basis @ coefficients
    return np.asarray(gains / np.log(2))


def robust_scale(values: Array) -> float:
    """Standard deviation of most of the values about 0."""
    return max(_NORMAL * float(np.median(np.abs(values))), 1e-6) if len(values) else 1e-6


def robust_mean(values: Array, scale: float) -> Array:
    """Mean over the views that outliers do not move, shape (K,); NaN values are unknown. 0 where nothing is known."""
    there = np.isfinite(values)
    filled = np.where(there, values, 0)
    with np.errstate(all="ignore"):
        middle = _median(values, there)
    for _ in range(3 if np.isfinite(scale) else 0):
        weights = there / (1 + ((filled - middle) / (SOFT * scale)) ** 2)
        middle = (weights * filled).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-12)
    return np.asarray(middle)


def _median(values: Array, there: NDArray[np.bool_]) -> Array:
    ordered = np.sort(np.where(there, values, np.inf), axis=0)
    number = there.sum(axis=0)
    columns = np.arange(values.shape[1])
    low, high = (ordered[np.maximum(index, 0), columns] for index in ((number - 1) // 2, np.maximum(number, 1) // 2))
    return np.where(number > 0, (low + high) / 2, 0.0)


def _basis(seen: Observed, field: Array, common: Common) -> Array:
    grazing = 1 - seen.cosine
    columns = [grazing, grazing**2, grazing**5]
    if common == "reflection":
        x, y, z = np.moveaxis(seen.normals, -1, 0)
        share = np.exp(np.median(field) - field)[None]
        columns += [share * one for one in (x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1)]
    return np.stack(columns, axis=-1)


def _solved(basis: Array, target: Array, weights: Array) -> tuple[Array, Array]:
    """Weighted least squares for the gains and the coefficients, with the field of each direction eliminated."""
    count, terms = len(target), basis.shape[-1]
    whole = np.maximum(weights.sum(axis=0), 1e-12)
    inner = basis - np.einsum("vkq,vk->kq", basis, weights) / whole[:, None]
    rest = target - (weights * target).sum(axis=0) / whole
    matrix, right = np.zeros((count + terms, count + terms)), np.zeros(count + terms)
    matrix[:count, :count] = np.diag(weights.sum(axis=1)) - (weights / whole) @ weights.T
    matrix[count:, :count] = np.einsum("vkq,vk->qv", inner, weights)
    matrix[:count, count:] = matrix[count:, :count].T
    weighted = (inner * weights[..., None]).reshape(-1, terms)
    matrix[count:, count:] = weighted.T @ inner.reshape(-1, terms)
    right[:count], right[count:] = (weights * rest).sum(axis=1), weighted.T @ rest.ravel()
    diagonal = np.diag(matrix)
    solution = np.linalg.solve(matrix + np.diag(_RIDGE * diagonal + 1e-9 * diagonal.max() + 1e-30), right)
    return solution[:count], solution[count:]

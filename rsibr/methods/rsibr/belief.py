"""How much of the model and of its residuals to believe, learnt from the stored views.

Each stored view is predicted from its neighbours as if it were new. Where the carried residuals do not tell the true
ones, because they are noise or change from view to view, they are attenuated. Where interpolating the maps without the
model does better than with it, the model is scaled down, lobe by lobe. See docs/method.md, section 8.6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.optimize import lsq_linear

from rsibr.methods.cosine_table import CosineTable

Array = NDArray[np.float64]

NODES = 6
"""Nodes of the trust in residuals, even in √cos θ."""

_TEXELS = 64  # texels a side of a stored map that are compared, at most
_RIDGE = 1e-3  # pull of the trust toward _PRIOR, over the mean of the normal matrix' diagonal
_PRIOR = 0.5
_MOST = 36  # views that are predicted or predict
_FEWEST = 3  # neighbours from which a stored view is predicted
_LEAST_COSINE = 1e-6


@dataclass(frozen=True, eq=False)
class StoredView:
    """A stored view with what the model predicts of it.

    Attributes
    ----------
    stored, predicted, albedo : ndarray, shape (N, N, 3)
        Stored radiance S and prediction P [W sr⁻¹ m⁻²], and directional albedo E.
    covered : ndarray, shape (N, N)
        Texels that hold a value.
    frame : ndarray, shape (3, 3)
        Columns x, y, v.
    """

    stored: Array
    predicted: Array
    albedo: Array
    covered: NDArray[np.bool_]
    frame: Array


@dataclass(frozen=True, eq=False)
class Belief:
    """What to believe.

    Attributes
    ----------
    residual : ndarray, shape (NODES,)
        Trust in carried residuals by √cos θ, in [0, 1].
    model : ndarray, shape (lobes,)
        Factor on the prediction of each lobe, in [0, 1].
    """

    residual: Array
    model: Array

    @property
    def is_full(self) -> bool:
        """Whether the model is believed as it is."""
        return bool((self.model == 1).all())

    def trust_table(self) -> CosineTable:
        """Put the trust in residuals on the device, in all channels."""
        return CosineTable.of(np.repeat(self.residual[:, None], 3, axis=1))

    @classmethod
    def full(cls, lobes: int) -> Belief:
        """Believe everything."""
        return cls(np.ones(NODES), np.ones(lobes))


Views = Mapping[int, StoredView]
"""Stored views by their index."""


def judged(triangles: NDArray[np.int64], count: int) -> dict[int, list[int]]:
    """Stored views that are taken for new, the first ones, and their neighbours in the triangulation.

    Parameters
    ----------
    triangles : ndarray, shape (T, 3)
        Triangulation of the views.
    count : int
        Number of views.

    Returns
    -------
    dict of int to list of int
        Neighbours of each, at least `_FEWEST`. No more than `_MOST` views in all.
    """
    found, used = dict[int, list[int]](), set[int]()
    for index in range(count):
        around = sorted({int(k) for triangle in triangles if index in triangle for k in triangle} - {index})
        if found and len(used | {index, *around}) > _MOST:
            break
        if len(around) >= _FEWEST:
            found[index] = around
            used |= {index, *around}
    return found


def learnt(
    views: Views, neighbours: Mapping[int, list[int]], lobes: int, by_lobe: Callable[[], list[dict[int, Array]]]
) -> Belief:
    """Learn from a bake what to believe.

    Parameters
    ----------
    views : mapping of int to StoredView
        Views of `neighbours`.
    neighbours : mapping of int to list of int
        From `judged`; if it is empty, everything is believed.
    lobes : int
        Number of lobes.
    by_lobe : callable
        Prediction of each lobe at each of `views`, each (N, N, 3); called only if the model as a whole does worse than
        none.

    Returns
    -------
    Belief
    """
    if not neighbours:
        return Belief.full(lobes)
    folds = [_Fold.of(views, index, around) for index, around in neighbours.items()]
    residuals = {index: view.predicted for index, view in views.items()}
    true = np.concatenate([fold.stored - fold.own(residuals) for fold in folds])
    carried = np.concatenate([fold.carried(views, residuals, damped=True) for fold in folds])
    weight = np.concatenate([fold.weight for fold in folds])
    hats = np.concatenate([fold.hats for fold in folds])
    trust = _trust(weight, hats, carried, true)
    with_model = weight * (true - carried * (hats @ trust)[:, None]) ** 2
    nothing = {index: np.zeros_like(view.predicted) for index, view in views.items()}
    bare = np.concatenate([fold.stored - fold.carried(views, nothing, damped=False) for fold in folds])
    without = weight * bare**2
    if (with_model.sum(axis=1) @ hats <= without.sum(axis=1) @ hats).all():
        return Belief(trust, np.ones(lobes))
    return _scaled(folds, views, by_lobe(), (weight, bare), Belief(trust, np.ones(lobes)), float(with_model.sum()))


def _scaled(
    folds: Sequence[_Fold],
    views: Views,
    by_lobe: list[dict[int, Array]],
    wanted: tuple[Array, Array],
    otherwise: Belief,
    error: float,
) -> Belief:
    """Factors on the lobes with which the model helps the interpolation most, if that errs less than `error`."""
    weight, bare = wanted
    root = np.sqrt(weight)
    columns = []
    for predicted in by_lobe:  # what the lobe adds to the interpolation: P_d − Σ w P_i, with S = P
        own = np.concatenate([fold.own(predicted) for fold in folds])
        nothing = {index: np.zeros_like(one) for index, one in predicted.items()}
        as_stored = {index: replace(view, stored=predicted[index]) for index, view in views.items()}
        moved = np.concatenate([fold.carried(as_stored, nothing, damped=False) for fold in folds])
        columns.append((root * (own - moved)).ravel())
    found = lsq_linear(np.stack(columns, axis=1), (root * bare).ravel(), bounds=(0, 1))
    if 2 * found.cost >= error:
        return otherwise
    return Belief(np.ones(NODES), np.where(found.x > 1 - 1e-3, 1 - 1e-3, found.x))


def _trust(weight: Array, hats: Array, carried: Array, true: Array) -> Array:
    """Trust at the nodes that brings carried residuals nearest to the true ones, in [0, 1]."""
    normal = hats.T @ ((weight * carried**2).sum(axis=1)[:, None] * hats)
    right = hats.T @ (weight * carried * true).sum(axis=1)
    ridge = _RIDGE * max(float(np.trace(normal)) / NODES, 1e-30)
    solved = np.linalg.solve(normal + ridge * np.eye(NODES), right + ridge * _PRIOR)
    return np.asarray(np.clip(solved, 0, 1))


@dataclass(frozen=True, eq=False)
class _Fold:
    """One stored view taken for new, at some of its texels.

    Attributes
    ----------
    view : int
        Its index.
    texels : tuple of ndarray of int
        Rows and columns of the texels.
    neighbours : list of (int, ndarray, ndarray, ndarray)
        Index of each neighbour, place of the texels in its image (2, n), weight c² and damping ρ² (n,).
    stored, weight : ndarray, shape (n, 3)
        Stored radiance, and weight of a squared error: that of relMSE.
    hats : ndarray, shape (n, NODES)
        Hat functions over √cos θ.
    """

    view: int
    texels: tuple[NDArray[np.int64], NDArray[np.int64]]
    neighbours: list[tuple[int, Array, Array, Array]]
    stored: Array
    albedo: Array
    weight: Array
    hats: Array

    @classmethod
    def of(cls, views: Views, index: int, around: Sequence[int]) -> _Fold:
        """Prepare view `index` with its neighbours."""
        view, size = views[index], len(views[index].stored)
        texels, normals = _test_normals(size)
        cosine = normals[:, 2]
        mirrored = (2 * cosine[:, None] * normals - np.array([0.0, 0.0, 1.0])) @ view.frame.T
        neighbours = []
        for k in around:
            half = mirrored + views[k].frame[:, 2]
            local = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9) @ views[k].frame
            there = np.maximum(local[:, 2], _LEAST_COSINE)
            overlap = np.minimum(there, cosine) / np.maximum(there, cosine)
            place = np.stack([(1 - local[:, 1]) / 2 * size - 0.5, (local[:, 0] + 1) / 2 * size - 0.5])
            neighbours.append((k, place, there**2, overlap**2))
        stored = view.stored[texels]
        mean = view.stored[view.covered].mean(axis=0)
        weight = 1 / np.maximum(stored**2 + (0.1 * mean) ** 2, 1e-30)
        hats = np.maximum(0, 1 - np.abs(np.sqrt(cosine)[:, None] * (NODES - 1) - np.arange(NODES)))
        return cls(index, texels, neighbours, stored, view.albedo[texels], weight, hats)

    def own(self, images: Mapping[int, Array]) -> Array:
        """Values of an image of this view at its texels, shape (n, 3)."""
        return np.asarray(images[self.view][self.texels])

    def carried(self, views: Views, predicted: Mapping[int, Array], *, damped: bool) -> Array:
        """Residuals S − P of the neighbours carried to this view, shape (n, 3); see `warped_residual`."""
        residual, total = np.zeros_like(self.stored), np.zeros(len(self.stored))
        for k, place, trusted, overlap in self.neighbours:
            image = _filled((views[k].stored - predicted[k]) / views[k].albedo, views[k].covered)
            found = np.stack([map_coordinates(image[..., c], place, order=1, mode="nearest") for c in range(3)], axis=1)
            residual += (trusted * (overlap if damped else 1))[:, None] * found
            total += trusted
        return self.albedo * residual / total[:, None]


def _test_normals(size: int) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], Array]:
    """Texels that are compared, whole ones inside the disk, and their normals."""
    step = -(-size // _TEXELS)
    rows, columns = (grid.ravel() for grid in np.meshgrid(*[np.arange(step // 2, size, step)] * 2, indexing="ij"))
    x, y = (columns + 0.5) * 2 / size - 1, 1 - (rows + 0.5) * 2 / size
    inside = np.hypot(x, y) < 1 - 1 / size
    x, y = x[inside], y[inside]
    return (rows[inside], columns[inside]), np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=1)


def _filled(image: Array, covered: NDArray[np.bool_]) -> Array:
    """Extend values beyond the disk from the nearest texel inside."""
    row, column = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(image[row, column])

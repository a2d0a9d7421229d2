"""How much of the model and of its residuals to believe, learnt from the stored views.

Each stored view is predicted from its neighbours as if it were new. Where the carried residuals do not tell the true
ones, because they are noise or change from view to view, they are attenuated. Where the paper's interpolation of the
maps does better than the model at some angle, lobes of the model are scaled down if that helps, and the two are weighed
against each other by angle. See docs/method.md, section 8.6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.optimize import lsq_linear

from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.warp_blend.source_maps import filled_outward
from rsibr.methods.warp_blend.warp import FADE_RADIUS

Array = NDArray[np.float64]

Image = NDArray[np.floating[Any]]
"""RGB image, shape (N, N, 3)."""

NODES = 6
"""Nodes of the trust in residuals, even in √cos θ."""

_TEXELS = 64  # texels a side of a stored map that are compared, at most
_RIDGE = 1e-3  # pull of the trust toward _PRIOR, over the mean of the normal matrix' diagonal
_PRIOR = 0.5
_MOST = 36  # views that are predicted or predict
_FEWEST = 3  # neighbours from which a stored view is predicted
_MARGIN = 0.4
_SCALED = 1e-3  # least reduction of a lobe
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

    stored: Image
    predicted: Image
    albedo: Image
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
    weight : ndarray, shape (NODES,)
        Weight of model and residuals against the paper's interpolation by √cos θ, in [0, 1].
    """

    residual: Array
    model: Array
    weight: Array

    @property
    def is_full(self) -> bool:
        """Whether the model is believed as it is."""
        return bool((self.model == 1).all())

    @property
    def is_hedged(self) -> bool:
        """Whether interpolation has a weight."""
        return bool((self.weight < 1).any())

    @classmethod
    def full(cls, lobes: int) -> Belief:
        """Believe everything."""
        return cls(np.ones(NODES), np.ones(lobes), np.ones(NODES))


def node_table(values: Array) -> CosineTable:
    """Put values at the nodes on the device, the same in all channels."""
    return CosineTable.of(np.repeat(values[:, None], 3, axis=1))


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
    views: Views, neighbours: Mapping[int, list[int]], lobes: int, by_lobe: Callable[[], list[dict[int, Image]]]
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
    weight, hats, stored = (np.concatenate([getattr(f, name) for f in folds]) for name in ("weight", "hats", "stored"))
    # ---- Model plus carried residuals, with the trust that brings these nearest to the true ones ----
    own = np.concatenate([fold.own({index: view.predicted for index, view in views.items()}) for fold in folds])
    residuals = _over_albedo(views, {index: view.stored - view.predicted for index, view in views.items()})
    carried = np.concatenate([fold.carried(residuals, damped=True) for fold in folds])
    trust = _trust(weight, hats, carried, stored - own)
    modelled = own + carried * (hats @ trust)[:, None]
    # ---- Against the paper's interpolation, angle by angle ----
    maps = {index: filled_outward(view.stored, view.covered) for index, view in views.items()}
    plain = np.concatenate([fold.interpolated(maps) for fold in folds])
    worse = _errors(weight, hats, modelled - stored) > _errors(weight, hats, plain - stored)
    if not worse.any():
        return Belief(trust, np.ones(lobes), np.ones(NODES))
    factors, scaled = _with_scaled_lobes(folds, views, by_lobe(), weight, stored)
    if _errors(weight, hats, scaled - stored).sum() < _errors(weight, hats, modelled - stored).sum():
        return Belief(np.ones(NODES), factors, _weight(weight, hats, scaled, plain, stored))
    return Belief(trust, np.ones(lobes), _weight(weight, hats, modelled, plain, stored))


def _over_albedo(views: Views, images: Mapping[int, Image]) -> dict[int, Image]:
    """Images of the views divided by the albedo, extended beyond the disk for lookups."""
    return {index: filled_outward(images[index] / view.albedo, view.covered) for index, view in views.items()}


def _errors(weight: Array, hats: Array, difference: Array) -> Array:
    """Weighted squared error around each node."""
    return np.asarray((weight * difference**2).sum(axis=1) @ hats)


def _with_scaled_lobes(
    folds: Sequence[_Fold], views: Views, by_lobe: list[dict[int, Image]], weight: Array, stored: Array
) -> tuple[Array, Array]:
    """Factors on the lobes with which the model helps an interpolation most, and the estimates that result.

    With factors μ the estimate is Σ w S + Σ_k μ_k (P_k − Σ w P_k), linear in μ; docs/method.md, eq. 40.
    """

    def moved(images: Mapping[int, Image]) -> Array:
        shared = _over_albedo(views, images)
        return np.concatenate([fold.carried(shared, damped=False) for fold in folds])

    bare = moved({index: view.stored for index, view in views.items()})
    added = [np.concatenate([fold.own(lobe) for fold in folds]) - moved(lobe) for lobe in by_lobe]
    root = np.sqrt(weight)
    columns = np.stack([(root * one).ravel() for one in added], axis=1)
    factors = lsq_linear(columns, (root * (stored - bare)).ravel(), bounds=(0, 1)).x
    factors = np.minimum(factors, 1 - _SCALED)  # a full belief is another case
    return factors, bare + np.tensordot(factors, np.stack(added), 1)


def _weight(weight: Array, hats: Array, modelled: Array, plain: Array, stored: Array) -> Array:
    """Weight of the model against the interpolation at the nodes; docs/method.md, eq. 41.

    What brings their mixture nearest to the stored maps, less a margin: a model that fails at some angle is believed
    less than it seems to deserve at others, since the maps were predicted from farther away than new views will be.
    """
    nearest = _trust(weight, hats, modelled - plain, stored - plain)
    return np.asarray(np.maximum(nearest - _MARGIN, 0) / (1 - _MARGIN))


def _trust(weight: Array, hats: Array, carried: Array, true: Array) -> Array:
    """Trust at the nodes that brings carried residuals nearest to the true ones, in [0, 1]; docs/method.md, eq. 39."""
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
    neighbours : list of _Neighbour
        Where the neighbours show what the texels show.
    stored, weight : ndarray, shape (n, 3)
        Stored radiance, and weight of a squared error: that of relMSE.
    hats : ndarray, shape (n, NODES)
        Hat functions over √cos θ.
    """

    view: int
    texels: tuple[NDArray[np.int64], NDArray[np.int64]]
    neighbours: list[_Neighbour]
    stored: Image
    albedo: Image
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
            apart = view.frame[:, 2] - views[k].frame[:, 2]
            away = normals[:, :2] - (apart / np.linalg.norm(apart)) @ view.frame[:, :2]
            fade = np.minimum(np.linalg.norm(away, axis=1) / FADE_RADIUS, 1)
            neighbours.append(_Neighbour(k, place, there**2, overlap**2, fade))
        stored = view.stored[texels]
        mean = view.stored[view.covered].mean(axis=0)
        weight = 1 / np.maximum(stored**2 + (0.1 * mean) ** 2, 1e-30)
        hats = np.maximum(0, 1 - np.abs(np.sqrt(cosine)[:, None] * (NODES - 1) - np.arange(NODES)))
        return cls(index, texels, neighbours, stored, view.albedo[texels], weight, hats)

    def own(self, images: Mapping[int, Image]) -> Array:
        """Values of an image of this view at its texels, shape (n, 3)."""
        return np.asarray(images[self.view][self.texels])

    def carried(self, quotients: Mapping[int, Image], *, damped: bool) -> Array:
        """Residuals over the albedo, from `_over_albedo`, carried to this view, shape (n, 3); see `warped_residual`."""
        residual, total = np.zeros_like(self.stored), np.zeros(len(self.stored))
        for one in self.neighbours:
            found = one.fetched(quotients[one.view])
            residual += (one.trusted * (one.overlap if damped else 1))[:, None] * found
            total += one.trusted
        return self.albedo * residual / total[:, None]

    def interpolated(self, maps: Mapping[int, Image]) -> Array:
        """Maps of the neighbours warped and blended as in the paper, shape (n, 3)."""
        radiance, total = np.zeros_like(self.stored), np.zeros(len(self.stored))
        for one in self.neighbours:
            radiance += one.fade[:, None] * one.fetched(maps[one.view])
            total += one.fade
        return np.asarray(radiance / np.maximum(total, 1e-30)[:, None])


@dataclass(frozen=True, eq=False)
class _Neighbour:
    """Where a neighbour shows what the texels of a view show: at the normals with the same mirror directions.

    Attributes
    ----------
    view : int
        Its index.
    place : ndarray, shape (2, n)
        Row and column in its image.
    trusted, overlap, fade : ndarray, shape (n,)
        Weight c² and damping ρ² of its residual, and the paper's confidence.
    """

    view: int
    place: Array
    trusted: Array
    overlap: Array
    fade: Array

    def fetched(self, image: Image) -> Array:
        """Bilinear lookup in an image (N, N, 3) of the neighbour, shape (n, 3)."""
        return np.stack([map_coordinates(image[..., c], self.place, order=1, mode="nearest") for c in range(3)], axis=1)


def _test_normals(size: int) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], Array]:
    """Texels that are compared, whole ones inside the disk, and their normals."""
    step = -(-size // _TEXELS)
    rows, columns = (grid.ravel() for grid in np.meshgrid(*[np.arange(step // 2, size, step)] * 2, indexing="ij"))
    x, y = (columns + 0.5) * 2 / size - 1, 1 - (rows + 0.5) * 2 / size
    inside = np.hypot(x, y) < 1 - 1 / size
    x, y = x[inside], y[inside]
    return (rows[inside], columns[inside]), np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=1)

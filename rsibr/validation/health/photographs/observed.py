"""What the maps of a capture show of common directions: the logarithm of the radiance on one grid of the sphere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from rsibr.store.map_file import MapFile
from rsibr.validation.health.photographs.sphere_grid import SphereGrid, grids, smoothing

Array = NDArray[np.float64]
Common = Literal["reflection", "normal"]
"""What is the same for all views: the mirror direction, or the normal."""

FLOOR = 0.05
"""Share of a capture's mean radiance that is added before the logarithm: noise in the dark does not count."""

FINE_DEG, COARSE_DEG = 1.5, 6.0
"""Standard deviations of the smoothing: detail is what lies between the two."""

_LEAST_COSINE = {"reflection": 0.4, "normal": 0.3}
"""Least cosine between normal and view: beyond, lobes are stretched."""

_KNOWN = 0.97


@dataclass(frozen=True, eq=False)
class Observed:
    """Maps of V views at the K directions of the grid.

    Attributes
    ----------
    values : ndarray, shape (V, K)
        Logarithm of the radiance; with detail alone, its difference from the smoothed one.
    known : ndarray of bool, shape (V, K)
        Where a view shows the direction.
    cosine : ndarray, shape (V, K)
        Between the normal and the view.
    normals : ndarray, shape (V, K, 3)
        In world coordinates.
    """

    values: Array
    known: NDArray[np.bool_]
    cosine: Array
    normals: Array


def logarithms(maps: Sequence[MapFile]) -> list[Array]:
    """Logarithm of each map's radiance, mean of the channels, continued a little beyond what is covered."""
    grey = [one.radiance.mean(axis=-1, dtype=np.float64) for one in maps]
    seen = [(one.coverage > 0).astype(np.float64) for one in maps]
    mean = float(np.median([image[covered > 0].mean() for image, covered in zip(grey, seen, strict=True)]))
    smooth = (
        gaussian_filter(image * covered, 0.7) / np.maximum(gaussian_filter(covered, 0.7), 1e-3)
        for image, covered in zip(grey, seen, strict=True)
    )
    return [np.log(np.maximum(image, 0) + FLOOR * max(mean, 1e-30)) for image in smooth]


def observed(
    images: Sequence[Array], maps: Sequence[MapFile], common: Common, *, detail: bool, turn: Array | None = None
) -> Observed:
    """Look all maps up.

    Parameters
    ----------
    images : sequence of ndarray, shape (N, N)
        From `logarithms`.
    maps : sequence of MapFile
        For frames and coverage.
    common : {"reflection", "normal"}
        What the grid's directions are.
    detail : bool
        Whether what is smooth is taken away.
    turn : ndarray, shape (2, 2), optional
        Applied to the places of the maps: how they would be seen upside down, or mirrored.
    """
    rows = [_of_view(image, one, common, detail, turn) for image, one in zip(images, maps, strict=True)]
    values, known, cosine, normals = (np.stack(part) for part in zip(*rows, strict=True))
    return Observed(values, known, cosine, normals)


def _of_view(
    image: Array, one: MapFile, common: Common, detail: bool, turn: Array | None
) -> tuple[Array, NDArray[np.bool_], Array, Array]:
    coarse, fine = grids()
    least = _LEAST_COSINE[common]
    normals, cosine = _normals(fine, one.frame, common)
    places = normals @ one.frame[:, :2] @ (np.eye(2) if turn is None else turn.T)
    row, column = (1 - places[:, 1]) / 2, (places[:, 0] + 1) / 2
    at = [side * len(image) - 0.5 for side in (row, column)]
    sampled = map_coordinates(image, at, order=1, mode="nearest")
    covered = map_coordinates((one.coverage > 0).astype(np.float64), at, order=1, mode="nearest")
    there = ((cosine > least - 0.1) & (covered > 0.99)).astype(np.float64)
    values, share = _smoothed(sampled, there, FINE_DEG)
    known = share > _KNOWN
    if detail:
        values = values - _smoothed(sampled, there, COARSE_DEG)[0]
    normals, cosine = _normals(coarse, one.frame, common)
    return values, known & (cosine > least), cosine, normals


def _normals(grid: SphereGrid, frame: Array, common: Common) -> tuple[Array, Array]:
    normals = grid.directions
    if common == "reflection":
        half = grid.directions + frame[:, 2]
        normals = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
    return normals, normals @ frame[:, 2]


def _smoothed(values: Array, there: Array, sigma_deg: float) -> tuple[Array, Array]:
    matrix = smoothing(sigma_deg)
    weight = matrix @ there
    return (matrix @ (values * there)) / np.maximum(weight, 1e-12), weight / matrix.sum(axis=1)

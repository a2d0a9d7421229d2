"""Silhouette of a sphere that nobody marked: the outline that most edges of the photograph agree on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.photographs.photograph import opencv
from rsibr.capture.silhouette.cone import Cone, fitted_cone
from rsibr.errors import InputError

_TRIES = 3000
_EDGES = 6000  # at most, drawn from all
_NEAR = 1.5  # pixels within which an edge agrees with an outline
_LEAST_ROUND = 0.6
"""Share of the outline along which edges must agree, more than edges anywhere would by chance."""

_MOST_BY_CHANCE = 0.7
"""Share by chance above which edges are everywhere, and tell nothing."""

_LEAST_RADIUS, _MOST_RADIUS = 0.04, 0.75  # of the picture's smaller side
_SECTORS = 72


def found_cone(camera: Pinhole, values: NDArray[np.floating], where: str, seed: int = 0) -> Cone:
    """Find the outline of a sphere.

    Parameters
    ----------
    camera : Pinhole
        Camera of the photograph.
    values : ndarray, shape (H, W, 3)
        Encoded values in [0, 1], or radiance.
    where : str
        File that an error names.
    seed : int
        Of the random tries.

    Raises
    ------
    InputError
        If no circle has edges along three fifths of its length: mark the sphere.
    """
    edges = _edges(values)
    rng = np.random.default_rng(seed)
    if len(edges) > _EDGES:
        edges = edges[rng.choice(len(edges), _EDGES, replace=False)]
    circle = _best_circle(edges, values.shape[:2], rng) if len(edges) > 3 else None
    if circle is None:
        raise InputError("no outline of a sphere was found", where=where, fix="give its --circle or a --mask")
    x, y, radius = circle
    for _ in range(3):  # the outline is an ellipse off the axis: the cone is fitted to the edges near it
        rim = _near_circle(edges, x, y, radius, _NEAR)
        cone = fitted_cone(camera, rim)
        outline = cone.rim(camera)
        x, y = outline.mean(axis=0)
        radius = float(np.hypot(*(outline - (x, y)).T).mean())
    return cone


def _edges(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Middles of the pixels on edges."""
    cv2: Any = opencv()
    grey = np.log1p(np.asarray(values, dtype=np.float64).mean(axis=2) / (np.median(values) + 1e-9))
    top = float(np.quantile(grey, 0.995)) or 1.0
    smooth = cv2.GaussianBlur((np.clip(grey / top, 0, 1) * 255).astype(np.uint8), (0, 0), 1.0)
    rows, columns = np.nonzero(cv2.Canny(smooth, 30, 90))
    return np.stack([columns + 0.5, rows + 0.5], axis=1)


def _best_circle(
    edges: NDArray[np.float64], shape: tuple[int, ...], rng: np.random.Generator
) -> tuple[float, float, float] | None:
    """Circle through three edges that has edges along most of its length."""
    triples = edges[rng.integers(0, len(edges), (_TRIES, 3))]
    centres, radii = _circles(triples)
    side = min(shape)
    fits = (radii > _LEAST_RADIUS * side) & (radii < _MOST_RADIUS * side)
    fits &= ((centres > 0) & (centres < (shape[1], shape[0]))).all(axis=1)
    best, most, density = None, _LEAST_ROUND, len(edges) / (shape[0] * shape[1])
    for centre, radius in zip(centres[fits], radii[fits], strict=True):
        chance = 1 - np.exp(-density * 2 * _NEAR * 2 * np.pi * radius / _SECTORS)
        if chance > _MOST_BY_CHANCE:
            continue
        share = (_agreement(edges, centre, float(radius)) - chance) / (1 - chance)
        if share > most:
            best, most = (float(centre[0]), float(centre[1]), float(radius)), share
    return best


def _agreement(edges: NDArray[np.float64], centre: NDArray[np.float64], radius: float) -> float:
    """Share of the sectors of a circle in which an edge lies on it."""
    offset = edges - centre
    on = np.abs(np.hypot(offset[:, 0], offset[:, 1]) - radius) < _NEAR
    sectors = ((np.arctan2(offset[on, 1], offset[on, 0]) / (2 * np.pi) + 0.5) * _SECTORS).astype(int) % _SECTORS
    return len(np.unique(sectors)) / _SECTORS


def _near_circle(edges: NDArray[np.float64], x: float, y: float, radius: float, near: float) -> NDArray[np.float64]:
    return edges[np.abs(np.hypot(edges[:, 0] - x, edges[:, 1] - y) - radius) < near]


def _circles(triples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres and radii of the circles through three points each; infinite for points on a line."""
    a, b, c = triples[:, 0], triples[:, 1], triples[:, 2]
    ab, ac = b - a, c - a
    twice_area = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    safe = np.where(np.abs(twice_area) < 1e-9, np.inf, twice_area)
    bb, cc = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    offset = np.stack([ac[:, 1] * bb - ab[:, 1] * cc, ab[:, 0] * cc - ac[:, 0] * bb], axis=1) / safe[:, None]
    radii = np.where(np.isinf(safe), np.inf, np.hypot(offset[:, 0], offset[:, 1]))
    return a + offset, radii

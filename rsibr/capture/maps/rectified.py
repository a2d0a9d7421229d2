"""Rectification: the sphere map of a photograph's own direction, and what the photograph tells of each texel.

A stored map shows the sphere from infinity. A texel with the mirror direction r takes what the photograph shows of r,
at a slightly different place of the sphere: for a glossy surface the same light. By normal, it takes the photograph's
radiance at the same place of the sphere: for a matte one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rsibr import backend
from rsibr.capture.balls.ball_photograph import BallPhotograph
from rsibr.capture.balls.reflection import seen
from rsibr.capture.maps.spread import pixel_variance
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import LEAST_COVERAGE, normal_from_disk, stored_coverage
from rsibr.store.map_file import MapFile

Rectification = Literal["reflection", "normal"]

GUARD_PIXELS = 2.0
"""Pixels inside the rim that are left out: they mix the sphere with what lies behind it."""

_LEAST_POINTS, _MOST_POINTS = 3, 12  # along a side of a texel
_POINTS_A_PIXEL = 1.5
_AT_ONCE = 2**21  # points whose weights are found together
_LEAST_SEEN = 0.25  # share of a texel's points below which it counts as unseen

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rectified:
    """Map of one photograph.

    Attributes
    ----------
    map : MapFile
        Radiance, its variance, and coverage: 0 where the photograph sees nothing.
    saturated : int
        Texels that hold pixels whose radiance is a lower bound.
    by_spread : bool
        Whether the variance is that of neighbouring pixels, because the photograph holds none.
    """

    map: MapFile
    saturated: int
    by_spread: bool


@backend.in_session
def rectified(ball: BallPhotograph, resolution: int, by: Rectification = "reflection") -> Rectified:
    """Resample a photograph to the sphere map of its direction, from the ball's centre to the camera.

    Parameters
    ----------
    ball : BallPhotograph
        Photograph whose camera is placed.
    resolution : int
        Texels a side.
    by : {"reflection", "normal"}
        Which points of photograph and map correspond.

    Raises
    ------
    InputError
        If the photograph shows nothing of the sphere, or `by` is neither.

    Notes
    -----
    A texel is the mean of points spread over it, each a bilinear lookup: a matrix W from pixels to texels. Its variance
    is W² times that of the pixels, whose noise is independent.
    """
    if by not in get_args(Rectification):
        raise InputError(f"unknown rectification '{by}'", where="rectify", fix="give reflection or normal")
    frame = view_frame(ball.view)
    image, by_spread = ball.image, not ball.image.variance.any()
    variance = pixel_variance(image.radiance) if by_spread else image.variance
    side = _points(ball, resolution)
    radiance, noise, bound = (np.zeros((resolution**2, 3)) for _ in range(3))
    share = np.zeros(resolution**2)
    step = max(_AT_ONCE // (resolution * side**2), 1)
    for top in range(0, resolution, step):
        rows = np.arange(top, min(top + step, resolution))
        texels = slice(rows[0] * resolution, (rows[-1] + 1) * resolution)
        weights, share[texels] = _weights(ball, frame, rows, resolution, side, by)
        radiance[texels] = weights @ image.radiance.reshape(-1, 3)
        noise[texels] = weights.power(2) @ variance.reshape(-1, 3)
        bound[texels] = weights @ image.saturated.reshape(-1, 3).astype(np.float64)
    coverage = stored_coverage(resolution) * share.reshape(resolution, resolution)
    coverage[(share.reshape(resolution, resolution) < _LEAST_SEEN) | (coverage < LEAST_COVERAGE)] = 0
    covered = coverage > 0
    if not covered.any():
        raise InputError("shows nothing of the sphere", where=ball.name, fix="check its pose and intrinsics")
    layers, spread, held = (_image(values, covered) for values in (radiance, noise, bound))
    found = MapFile(frame[:, 2].copy(), frame, {"radiance": layers}, spread, coverage.astype(np.float32))
    return Rectified(found, int((held > 0).any(axis=2).sum()), by_spread)


def _image(values: Array, covered: NDArray[np.bool_]) -> NDArray[np.float32]:
    return np.where(covered[..., None], values.reshape(*covered.shape, 3), 0).astype(np.float32)


def _points(ball: BallPhotograph, resolution: int) -> int:
    """Points along a side of a texel: denser than the pixels."""
    pixels = 2 * ball.radius_pixels / resolution
    return min(max(math.ceil(_POINTS_A_PIXEL * pixels), _LEAST_POINTS), _MOST_POINTS)


def _weights(
    ball: BallPhotograph, frame: Array, rows: NDArray[np.int64], resolution: int, side: int, by: Rectification
) -> tuple[csr_array, Array]:
    """Weights of the pixels in the texels of some rows, and the share of each texel's part of the disk that is seen."""
    inner = (np.arange(side) + 0.5) / side
    y = 1 - 2 * (rows[:, None] + inner).ravel() / resolution
    x = 2 * (np.arange(resolution)[:, None] + inner).ravel() / resolution - 1
    x, y = (part.ravel() for part in np.meshgrid(x, y))
    number_of = np.arange(len(rows) * resolution).reshape(len(rows), 1, resolution, 1)
    texel = np.broadcast_to(number_of, (len(rows), side, resolution, side)).ravel()
    inside = x * x + y * y < 1
    x, y, texel = x[inside], y[inside], texel[inside]
    place, sees = _places(ball, frame, x, y, by)
    count = len(rows) * resolution
    total = np.bincount(texel, minlength=count)
    number = np.bincount(texel[sees], minlength=count)
    matrix = _bilinear(place[sees], texel[sees], (count, ball.image.size), 1 / np.maximum(number, 1))
    return matrix, number / np.maximum(total, 1)


def _places(
    ball: BallPhotograph, frame: Array, x: Array, y: Array, by: Rectification
) -> tuple[Array, NDArray[np.bool_]]:
    """Places of the photograph for points of the map, and whether it shows the sphere there, the guard apart."""
    to_world = mi.Matrix3f(frame.astype(np.float32))
    n = normal_from_disk(mi.Point2f(x.astype(np.float32), y.astype(np.float32)))
    guard = GUARD_PIXELS / float(np.sqrt(np.prod(ball.camera.focal)))
    if by == "reflection":
        found = seen(ball, to_world @ mi.Vector3f(2 * n.x * n.z, 2 * n.y * n.z, 2 * n.z * n.z - 1))
        place, margin = np.array(found.place, dtype=np.float64).T, np.array(found.margin)
    else:
        point = np.array(to_world @ n, dtype=np.float64).T
        toward = ball.camera.position - point
        faces = (toward * point).sum(axis=1) > 0
        place = ball.camera.project(point)
        off = np.arccos(np.clip(toward @ ball.view / np.linalg.norm(toward, axis=1), -1, 1))
        margin = np.where(faces, math.asin(1 / ball.distance) - off, -1.0)
    width, height = ball.image.size
    within = (place >= 0.5).all(axis=1) & (place <= (width - 0.5, height - 0.5)).all(axis=1)
    return place, within & (margin > guard)


def _bilinear(place: Array, texel: NDArray[np.int64], size: tuple[int, tuple[int, int]], scale: Array) -> csr_array:
    """Matrix from pixels to texels of the bilinear lookups at places, each times the scale of its texel."""
    count, (width, height) = size
    corner = np.clip(np.floor(place - 0.5).astype(np.int64), 0, (width - 2, height - 2))
    part = place - 0.5 - corner
    entries = []
    for dx, share_x in ((0, 1 - part[:, 0]), (1, part[:, 0])):
        for dy, share_y in ((0, 1 - part[:, 1]), (1, part[:, 1])):
            entries.append((share_x * share_y, (corner[:, 1] + dy) * width + corner[:, 0] + dx))
    values = np.concatenate([share for share, _ in entries]) * np.tile(scale[texel], 4)
    pixels = np.concatenate([pixel for _, pixel in entries])
    return csr_array((values, (np.tile(texel, 4), pixels)), shape=(count, width * height))

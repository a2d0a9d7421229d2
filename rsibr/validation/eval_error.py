"""Error and time of a method's `eval`: what objects are shaded with, judged beside whole maps.

A reference holds means over texels. So `eval` is asked at random points of each texel, and their mean is compared; what
the points scatter is measured and taken out, as the noise of the reference is.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.to_device import to_device
from rsibr.methods.map_texels import frame_from
from rsibr.methods.protocol import Method
from rsibr.store.noise import COVERED
from rsibr.validation.estimate import Estimate
from rsibr.validation.metrics import relative_mse_of_samples
from rsibr.validation.reference import Reference

POINTS = 4
"""Points of each texel: their scatter, by which they are debiased, has three degrees of freedom."""

TIMED_RUNS = 3
"""Runs after the first, which compiles; their median is the time."""

_POINT_BRANCH = 0x706F_696E
"""Branch of the seed tree (the letters "poin")."""


@dataclass(frozen=True)
class EvalError:
    """A method's `eval` at one view.

    Attributes
    ----------
    rel_mse : Estimate
        Of its mean over each texel, the noise of the reference and the scatter of the points taken out.
    seconds : float
        Time of one evaluation [s]: of all points at once, device finished, nothing compiled, divided by their count.
    """

    rel_mse: Estimate
    seconds: float


def judge_eval(method: Method, frame: NDArray[np.float64], reference: Reference, seed: int) -> EvalError:
    """Judge `eval` at random points of every texel that a map is judged by.

    Parameters
    ----------
    method : Method
        The method.
    frame : ndarray, shape (3, 3)
        Frame of the view, columns x, y, v.
    reference : Reference
        Path-traced map of the view.
    seed : int
        Root of the seed tree; the points are the same for every method.
    """
    judged = reference.coverage >= COVERED
    points = disk_points(
        judged, POINTS, np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_POINT_BRANCH,)))
    )
    radiance, seconds = _evaluated(method, frame, points)
    buffers = reference.buffers[:, judged].astype(np.float64)
    error = relative_mse_of_samples(radiance.reshape(POINTS, -1, 3), buffers)
    return EvalError(error, seconds / len(points))


def disk_points(texels: NDArray[np.bool_], count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Random points, uniform over the part of each texel inside the unit disk.

    Parameters
    ----------
    texels : ndarray of bool, shape (N, N)
        Texels to draw in, each with a good part of its area inside the disk.
    count : int
        Points a texel.
    generator : Generator
        Source of the random numbers.

    Returns
    -------
    ndarray, shape (count × T, 2)
        Map points; all first points of the T texels in row-major order, then all second ones, and so on.
    """
    row, column = (np.tile(index, count) for index in np.nonzero(texels))
    step = 2.0 / len(texels)
    corner = np.stack([column * step - 1, 1 - (row + 1) * step], axis=1)
    points = corner + step * generator.random(corner.shape)
    while (outside := np.flatnonzero((points**2).sum(axis=1) >= 1)).size:
        points[outside] = corner[outside] + step * generator.random((outside.size, 2))
    return points


@backend.in_session
def _evaluated(
    method: Method, frame: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Radiance at map points, shape (M, 3), and the median time of evaluating all of them."""
    columns = mi.Float(frame.T.ravel().tolist())
    dr.make_opaque(columns)
    flat = to_device(mi.Float, points.astype(np.float32))
    lanes = dr.arange(mi.UInt32, len(points))
    x, y = (dr.gather(mi.Float, flat, 2 * lanes + axis) for axis in (0, 1))
    to_world = frame_from(columns)
    n = to_world @ mi.Vector3f(x, y, dr.sqrt(dr.maximum(1 - x * x - y * y, 0)))
    v = mi.Vector3f(to_world[0, 2], to_world[1, 2], to_world[2, 2]) + dr.zeros(mi.Vector3f, len(points))
    dr.eval(n, v)
    runs = []
    for _ in range(TIMED_RUNS + 1):
        backend.synchronize()
        start = time.perf_counter()
        radiance = method.eval(n, v)
        dr.eval(radiance)
        backend.synchronize()
        runs.append(time.perf_counter() - start)
    shown = np.array(radiance, dtype=np.float64).T
    return np.broadcast_to(shown.reshape(-1, 3), (len(points), 3)), median(runs[1:])

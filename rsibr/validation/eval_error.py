"""Error and time of a method's `eval`, which shades objects, in addition to those of whole maps.

A reference holds means over texels. `eval` is therefore evaluated at random points of each texel and averaged. The
variance of that mean is estimated and subtracted from the error, like the noise of the reference.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
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
"""Points a texel; their variance, used to debias the error, has three degrees of freedom."""

TIMED_RUNS = 1
"""Timed runs after a first one, which compiles; a validation takes the mean over its views."""

_POINT_BRANCH = 0x706F_696E
"""Branch of the seed tree (the letters "poin")."""


@dataclass(frozen=True)
class EvalError:
    """Error and time of a method's `eval` at one view.

    Attributes
    ----------
    rel_mse : Estimate
        RelMSE of the mean over each texel, with the noise of the reference and the variance of the points subtracted.
    seconds : float
        Time of one evaluation [s]: time of all points in one launch until the device has finished, without
        compilation, divided by their number.
    """

    rel_mse: Estimate
    seconds: float


def judge_eval(method: Method, frame: NDArray[np.float64], reference: Reference, seed: int) -> EvalError:
    """Measure error and time of `eval` at random points of every texel with coverage ≥ ½; the cost keeps the time.

    Parameters
    ----------
    method : Method
        Method to measure.
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
    method.cost = replace(method.cost, lookup_seconds=seconds / len(points))
    return EvalError(error, seconds / len(points))


def disk_points(texels: NDArray[np.bool_], count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Draw random points, uniformly over the part of each texel inside the unit disk.

    Parameters
    ----------
    texels : ndarray of bool, shape (N, N)
        Texels to draw points in; by rejection, so a considerable part of each must lie inside the disk.
    count : int
        Points a texel.
    generator : Generator
        Random number generator.

    Returns
    -------
    ndarray, shape (count × T, 2)
        Map points: the first point of each of the T texels in row-major order, then all second points, and so on.
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
    """Radiance at map points, shape (M, 3), and the median time of one launch for all of them [s]."""
    # ---- Normals and views, evaluated before the clock starts ----
    columns = mi.Float(frame.T.ravel().tolist())
    dr.make_opaque(columns)
    flat = to_device(mi.Float, points.astype(np.float32))
    lanes = dr.arange(mi.UInt32, len(points))
    x, y = (dr.gather(mi.Float, flat, 2 * lanes + axis) for axis in (0, 1))
    to_world = frame_from(columns)
    n = to_world @ mi.Vector3f(x, y, dr.sqrt(dr.maximum(1 - x * x - y * y, 0)))
    v = mi.Vector3f(to_world[0, 2], to_world[1, 2], to_world[2, 2]) + dr.zeros(mi.Vector3f, len(points))
    dr.eval(n, v)
    # ---- Timed runs; the first one compiles ----
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

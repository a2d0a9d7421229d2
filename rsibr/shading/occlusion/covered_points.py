"""Points of the surface that other surfaces cover, and what their neighbours say in their place.

Under a trim, a pane or another shape that lies on a surface all light is hidden from a point that nobody sees.
Interpolated, it would darken the triangles around, which lie in the open.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.shading.occlusion.gathering import Pattern, Places
from rsibr.shading.occlusion.surface_points import SurfacePoints

RAYS = 32
"""Cosine-weighted rays by which a point is judged."""

COVERED = 0.6
"""Share of the rays that are stopped within the distance to the next points from which a point is covered."""

_PASSES = 16  # from the edge of what is covered inward


def covered(scene: mi.Scene, points: SurfacePoints, lift: float) -> NDArray[np.bool_]:
    """Whether each point is covered, shape (N,); `lift` is that of the scene."""
    reach = _reach(points)
    found = [np.zeros(0, np.bool_)]
    first = 0
    for part in Places.of(points.positions, points.normals, lift):
        size = dr.width(part.p)
        found.append(_stopped(scene, part, to_device(mi.Float, reach[first : first + size])) >= COVERED * RAYS)
        first += size
    return np.concatenate(found)


def from_neighbours(
    values: NDArray[np.float32], hidden: NDArray[np.bool_], corners: NDArray[np.uint32]
) -> NDArray[np.float32]:
    """Values with those of covered points replaced by the mean of their neighbours', from the edge inward.

    Parameters
    ----------
    values : ndarray, shape (N, 3)
        Values at the points.
    hidden : ndarray, shape (N,)
        Points that are covered; those without a way to others keep their value.
    corners : ndarray, shape (F, 3)
        Points of each triangle.
    """
    values, unknown = values.copy(), hidden.copy()
    for _ in range(_PASSES):
        if not unknown.any():
            break
        around = corners[unknown[corners].any(axis=1)]
        total, count = np.zeros((len(values), 3)), np.zeros(len(values))
        for own, other in ((0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)):
            known = ~unknown[around[:, other]]
            np.add.at(total, around[known, own], values[around[known, other]])
            np.add.at(count, around[known, own], 1)
        now = unknown & (count > 0)
        if not now.any():
            break
        values[now] = total[now] / count[now, None]
        unknown &= ~now
    return values


def _reach(points: SurfacePoints) -> NDArray[np.float32]:
    """Mean length of the edges at each point, shape (N,)."""
    total, count = np.zeros(len(points)), np.zeros(len(points))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        one, other = points.corners[:, a], points.corners[:, b]
        length = np.linalg.norm(points.positions[one] - points.positions[other], axis=1)
        for end in (one, other):
            np.add.at(total, end, length)
            np.add.at(count, end, 1)
    return (total / np.maximum(count, 1)).astype(np.float32)


def _stopped(scene: mi.Scene, places: Places, reach: mi.Float) -> NDArray[np.uint32]:
    """Number of rays that are stopped within `reach`."""
    pattern, frame = Pattern.of(RAYS, dr.width(places.p), 0), mi.Frame3f(places.n)
    count = dr.opaque(mi.UInt32, RAYS)

    def add(k: mi.UInt32, stopped: mi.UInt32) -> tuple[mi.UInt32, mi.UInt32]:
        ray = mi.Ray3f(places.p, frame.to_world(pattern.direction(k)))
        ray.maxt = reach
        return k + 1, stopped + dr.select(scene.ray_test(ray), mi.UInt32(1), 0)

    state = (mi.UInt32(0), dr.zeros(mi.UInt32, dr.width(places.p)))
    _, stopped = dr.while_loop(state, lambda k, _: k < count, add, label="covering_rays")
    return np.array(stopped)

"""Grid of points in a triangle: s + 1 along each edge, and the s² small triangles between them.

Point (i, j) lies at the barycentric place (i/s, j/s), weights of the second and the third vertex. Row i starts at point
i(s + 1) − i(i − 1)/2 and at small triangle 2si − i²; the small triangles of a row alternate, upright first. Values at
such grids are mesh colours: Yuksel, Keyser & House (2010).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray


def grid_places(steps: int) -> NDArray[np.float64]:
    """Barycentric places of the points of a triangle with so many steps, shape ((s+1)(s+2)/2, 2)."""
    return np.array([(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)], np.float64) / steps


def grid_corners(steps: int) -> NDArray[np.uint32]:
    """Points of each small triangle, shape (s², 3), in the order of `small_triangle`."""

    def point(i: int, j: int) -> int:
        return i * (steps + 1) - i * (i - 1) // 2 + j

    rows = []
    for i in range(steps):
        for j in range(steps - i):
            rows.append((point(i, j), point(i + 1, j), point(i, j + 1)))
            if i + j < steps - 1:
                rows.append((point(i + 1, j + 1), point(i, j + 1), point(i + 1, j)))
    return np.array(rows, np.uint32)


def small_triangle(place: mi.Point2f, steps: mi.UInt32) -> tuple[mi.UInt32, mi.Point2f]:
    """Small triangle at a place of a triangle, and the place in it.

    Parameters
    ----------
    place : mi.Point2f
        Weights of the second and the third vertex.
    steps : mi.UInt32
        Steps along an edge, ≥ 1.

    Returns
    -------
    number : mi.UInt32
        Row of `grid_corners`.
    place : mi.Point2f
        Weights of its second and third point.
    """
    scaled = mi.Point2f(dr.maximum(place.x, 0), dr.maximum(place.y, 0)) * mi.Float(steps)
    i = dr.minimum(mi.UInt32(scaled.x), steps - 1)
    j = dr.minimum(mi.UInt32(scaled.y), steps - 1 - i)
    u, v = dr.minimum(scaled.x - mi.Float(i), 1), dr.minimum(scaled.y - mi.Float(j), 1)
    is_upper = (u + v > 1) & (i + j + 1 < steps)
    number = 2 * steps * i - i * i + 2 * j + dr.select(is_upper, mi.UInt32(1), 0)
    return number, mi.Point2f(dr.select(is_upper, 1 - u, u), dr.select(is_upper, 1 - v, v))

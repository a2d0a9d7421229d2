"""Equal-angle charts of the sphere: six faces of a cube that overlap, with cubic interpolation between their nodes.

Face axes are those of the cube projection (+x, −x, +y, −y, +z, −z). A point (u, v) of a face lies in the direction
(tan πu/4, tan πv/4, 1) of its axes: u, v ∈ [−1, 1] is the face itself, and a chart goes on beyond it. In angle the
nodes of a face are evenly spaced to within 1.5 (the planar cube: to within 3).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FACES = 6

AXES: Array = np.array(
    [
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    dtype=np.float64,
)
"""Right, up and outward of each face in world coordinates, shape (6, 3, 3)."""

STENCIL = 4
"""Nodes a side of cubic interpolation."""


def node_tangents(size: int, margin: int) -> Array:
    """Tangents tan(πu/4) of the nodes along a side, u = (2i+1)/size − 1 for i = −margin … size + margin − 1."""
    u = (2 * np.arange(-margin, size + margin) + 1) / size - 1
    return np.asarray(np.tan(np.pi / 4 * u))


def places_in_charts(d: Array, margin: float) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Points of all charts in which directions lie.

    Parameters
    ----------
    d : ndarray, shape (n, 3)
        Unit directions.
    margin : float
        How far a chart goes on beyond its face, in units of u.

    Returns
    -------
    point, face : ndarray, shape (k,)
        Index into `d`, and the face of the chart. With margin 0 each direction is found once.
    place : ndarray, shape (k, 2)
        (u, v).
    """
    if margin == 0:
        axis = np.abs(d).argmax(axis=1)
        own = 2 * axis + (np.take_along_axis(d, axis[:, None], axis=1)[:, 0] < 0)
        inside = [np.flatnonzero(own == face) for face in range(FACES)]
    else:
        columns = np.ascontiguousarray(d.T)
        inside = [_within_chart(columns, face, np.tan(np.pi / 4 * (1 + margin))) for face in range(FACES)]
    places = []
    for axes, point in zip(AXES, inside, strict=True):
        local = d[point] @ axes.T
        places.append(np.arctan(local[:, :2] / local[:, 2:]) * (4 / np.pi))
    face = np.repeat(np.arange(FACES), [len(point) for point in inside])
    return np.concatenate(inside), face, np.concatenate(places)


def _within_chart(columns: Array, face: int, reach: float) -> NDArray[np.intp]:
    """Directions, shape (3, n), at most `reach` to the side of a face's middle, in units of the distance outward."""
    axis = face // 2
    ahead = np.flatnonzero(columns[axis] < 0 if face % 2 else columns[axis] > 0)
    limit = reach * np.abs(columns[axis, ahead])
    beside = [np.abs(columns[other, ahead]) <= limit for other in range(3) if other != axis]
    return np.asarray(ahead[beside[0] & beside[1]])


def spread(place: Array, face: NDArray[np.intp], values: Array, size: int, margin: int) -> NDArray[np.float32]:
    """Share values out among the 4 × 4 nearest nodes, with the weights of cubic interpolation (its adjoint).

    Sums, centroids and moments up to the third in (u, v) are kept, which makes sums of a smooth kernel over the nodes
    equal to those over the points to fourth order in the spacing.

    Parameters
    ----------
    place : ndarray, shape (n, 2)
        Points (u, v) of the charts of `face`; their stencils lie in the chart.
    values : ndarray, shape (n, C)
        Quantities to share out.
    size, margin : int
        Nodes a side of a face, and beyond it.

    Returns
    -------
    ndarray, shape (6, size + 2 margin, size + 2 margin, C), float32
    """
    side = size + 2 * margin
    at = (place + 1) * (0.5 * size) - 0.5 + margin
    first = np.floor(at).astype(np.intp) - 1
    weights = lagrange(at - first - 1)
    corner = (face * side + first[:, 1]) * side + first[:, 0]
    total = np.zeros((FACES * side * side, values.shape[1]))
    for row in range(STENCIL):
        for column in range(STENCIL):
            weight = weights[row][:, 1] * weights[column][:, 0]
            index = corner + row * side + column
            for channel in range(values.shape[1]):
                total[:, channel] += np.bincount(index, weight * values[:, channel], len(total))
    return total.reshape(FACES, side, side, -1).astype(np.float32)


def lagrange(t: Array) -> list[Array]:
    """Weights of the nodes −1, 0, 1, 2 in cubic interpolation at t ∈ [0, 1]; NumPy or Dr.Jit."""
    before, after, beyond = t + 1, t - 1, t - 2
    return [
        t * after * beyond * (-1 / 6),
        before * after * beyond * 0.5,
        before * t * beyond * (-0.5),
        before * t * after * (1 / 6),
    ]


def interpolated(nodes: mi.Float, size: int, margin: int, face: mi.UInt32, place: mi.Point2f) -> mi.Vector4f:
    """Cubic interpolation of four channels in a chart, nowhere below the least of the four nodes around and zero.

    Without that bound it would undershoot next to steep flanks.

    Parameters
    ----------
    nodes : mi.Float
        Values of shape (6, size + 2 margin, size + 2 margin, 4), flat.
    size, margin : int
        Nodes a side of a face, and beyond it.
    face, place : mi.UInt32, mi.Point2f
        Chart and (u, v).
    """
    side, half = (dr.opaque(kind, value) for kind, value in ((mi.UInt32, size + 2 * margin), (mi.Float, 0.5 * size)))
    offset = dr.opaque(mi.Float, margin - 0.5)
    x, y = (dr.fma(one + 1, half, offset) for one in (place.x, place.y))
    left, down = mi.UInt32(x), mi.UInt32(y)
    across, along = lagrange(x - mi.Float(left)), lagrange(y - mi.Float(down))
    corner = (face * side + down - 1) * side + left - 1
    total, least = mi.Vector4f(0), mi.Vector4f(dr.inf)
    for row in range(STENCIL):
        for column in range(STENCIL):
            value = dr.gather(mi.Vector4f, nodes, corner + row * side + column)
            total = dr.fma(value, across[column] * along[row], total)
            if {row, column} <= {1, 2}:
                least = dr.minimum(least, value)
    return dr.maximum(total, dr.maximum(least, 0))


def place_in_face(d: mi.Vector3f) -> tuple[mi.UInt32, mi.Point2f]:
    """Face of a direction, and its (u, v)."""
    x, y, z = dr.abs(d.x), dr.abs(d.y), dr.abs(d.z)
    is_x, is_y = (x >= y) & (x >= z), y >= z
    axis = dr.select(is_x, mi.UInt32(0), dr.select(is_y, mi.UInt32(1), mi.UInt32(2)))
    major = dr.select(is_x, d.x, dr.select(is_y, d.y, d.z))
    face = 2 * axis + dr.select(major < 0, mi.UInt32(1), mi.UInt32(0))
    axes = to_axes(face)
    local = mi.Vector3f(*(dr.dot(one, d) for one in axes))
    return face, mi.Point2f(dr.atan(local.x / local.z), dr.atan(local.y / local.z)) * (4 / dr.pi)


def to_axes(face: mi.UInt32) -> tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f]:
    """Right, up and outward of each lane's face."""
    table = mi.Float(AXES.astype(np.float32).ravel())

    def axis(which: int) -> mi.Vector3f:
        return mi.Vector3f(*(dr.gather(mi.Float, table, face * 9 + 3 * which + k) for k in range(3)))

    return axis(0), axis(1), axis(2)

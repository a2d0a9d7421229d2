"""Grid over the sphere that lists the triangles near each cell: point location in constant time a lane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rsibr.geometry.projections.octahedral import square_from_direction, texel_directions
from rsibr.geometry.to_device import to_device

_CELLS_A_TRIANGLE = 16
"""Cells for each triangle: 1.5 triangles are listed in a mean cell; with a quarter of the cells, 2."""
_LEAST_SIDE, _MOST_SIDE = 64, 1024
"""Cells a side; even, so that the edges of the octahedron lie between cells or on their diagonals."""
_SLACK = 1e-5  # rounding of directions and distances in float32; a cell of the finest grid is 4e-3 wide
_BLOCK = 4096  # cells whose triangles are searched at a time, to bound the memory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TriangleGrid:
    """Triangles that cover the sphere, listed by the cells of an octahedral grid that they may touch.

    Attributes
    ----------
    first : mi.UInt32
        Place of each cell's first triangle in `listed`, row-major; one more entry ends the last cell.
    listed : mi.UInt32
        Indices of triangles, cell by cell.
    corners : mi.Float
        Corners of the triangles, nine floats each, flat.
    side : mi.UInt32
        Cells a side (opaque, so that grids of any size share one kernel).

    Notes
    -----
    A hierarchy of bounding caps, which lanes descend at different paces, takes 20 to 40 times as long.
    """

    first: mi.UInt32
    listed: mi.UInt32
    corners: mi.Float
    side: mi.UInt32

    @classmethod
    def build(cls, corners: Array) -> TriangleGrid:
        """Build the grid.

        Parameters
        ----------
        corners : ndarray, shape (M, 3, 3)
            Corners of each triangle, unit vectors, counter-clockwise seen from outside; together they cover the sphere.
        """
        side = min(max(2 * math.ceil(math.sqrt(_CELLS_A_TRIANGLE * len(corners)) / 2), _LEAST_SIDE), _MOST_SIDE)
        cell, triangle = _touching(*_cells(side), corners)
        order = np.lexsort((triangle, cell))
        first = np.searchsorted(cell[order], np.arange(side * side + 1))
        return cls(
            first=to_device(mi.UInt32, first.astype(np.uint32)),
            listed=to_device(mi.UInt32, triangle[order].astype(np.uint32)),
            corners=to_device(mi.Float, corners.astype(np.float32)),
            side=dr.opaque(mi.UInt32, side),
        )

    def locate(self, v: mi.Vector3f) -> mi.UInt32:
        """Index of the triangle that contains each direction.

        Parameters
        ----------
        v : mi.Vector3f
            Unit directions, one a lane.

        Returns
        -------
        mi.UInt32
            Among the triangles listed in its cell, the one with the largest signed distance from `v` to its nearest
            side. A direction that rounding places just outside every triangle still gets a neighbouring one.
        """
        cell = self._cell(v)
        start, end = dr.gather(mi.UInt32, self.first, cell), dr.gather(mi.UInt32, self.first, cell + 1)
        alone = dr.gather(mi.UInt32, self.listed, start)
        listed, corners = self.listed, self.corners  # read outside: the loop body is traced

        def step(place: mi.UInt32, best: mi.UInt32, depth: mi.Float) -> tuple[mi.UInt32, mi.UInt32, mi.Float]:
            triangle = dr.gather(mi.UInt32, listed, place)
            inside = _depth(corners, triangle, v)
            deeper = inside > depth
            return place + 1, dr.select(deeper, triangle, best), dr.select(deeper, inside, depth)

        _, best, _ = dr.while_loop(
            state=(dr.select(end - start > 1, start, end), alone, mi.Float(-dr.inf)),
            cond=lambda place, _best, _depth: place < end,
            body=step,
            labels=("place", "best", "depth"),
            label="locate_triangle",
        )
        return best

    def _cell(self, v: mi.Vector3f) -> mi.UInt32:
        """Cell of each direction, row-major."""
        half = mi.Float(self.side) * 0.5
        p, last = square_from_direction(v), mi.Int32(self.side) - 1
        column, row = (mi.UInt32(dr.clip(mi.Int32((x + 1) * half), 0, last)) for x in (p.x, p.y))
        return row * self.side + column


def _depth(corners: mi.Float, triangle: mi.UInt32, v: mi.Vector3f) -> mi.Float:
    """Signed distance from `v` to the nearest side of the triangle, positive inside."""
    a, b, c = (dr.gather(mi.Vector3f, corners, 3 * triangle + k) for k in range(3))

    def distance_to_side(p: mi.Vector3f, q: mi.Vector3f) -> mi.Float:
        # det(v, p − v, q − v) has no cancellation near the side; divided by |q − p| it is the distance
        return dr.dot(v, dr.cross(p - v, q - v)) * dr.rsqrt(dr.squared_norm(q - p))

    return dr.minimum(dr.minimum(distance_to_side(a, b), distance_to_side(b, c)), distance_to_side(c, a))


def _cells(side: int) -> tuple[Array, Array]:
    """Centres, shape (side², 3), and radii [chord] of caps around the cells of a grid.

    The sides of a cell, and the edges of the octahedron that cut it along a diagonal, are arcs of great circles, so
    that a cap around its corners holds the cell.
    """
    centre, *around = (
        np.array(texel_directions(side, right, down), dtype=np.float64).T
        for right, down in ((0.5, 0.5), (0, 0), (0, 1), (1, 0), (1, 1))
    )
    return centre, np.max([np.linalg.norm(corner - centre, axis=1) for corner in around], axis=0) + _SLACK


def _touching(centre: Array, radius: Array, corners: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of a cell and a triangle that may touch: no side of the triangle has the whole cap of the cell outside."""
    middle, reach = _caps(corners)
    across = np.cross(corners, np.roll(corners, -1, axis=1))
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    pairs = []
    for sized in _by_size(reach):
        near = cKDTree(middle[sized])
        for begin in range(0, len(centre), _BLOCK):
            some = slice(begin, begin + _BLOCK)
            farthest = float(reach[sized].max() + radius[some].max())
            found = cKDTree(centre[some]).sparse_distance_matrix(near, farthest, output_type="ndarray")
            cell, triangle = found["i"] + begin, sized[found["j"]]
            outside = -np.einsum("pki,pi->pk", across[triangle], centre[cell]).min(axis=1)
            touches = outside <= radius[cell]
            pairs.append((cell[touches], triangle[touches]))
    cell, triangle = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return cell, triangle


def _caps(corners: Array) -> tuple[Array, Array]:
    """Centres, shape (M, 3), and radii [chord] of caps around triangles."""
    middle = corners.sum(axis=1)
    length = np.linalg.norm(middle, axis=1, keepdims=True)
    middle = np.where(length > 1e-9, middle / np.maximum(length, 1e-9), corners[:, 0])
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    return middle, np.where(reach < math.sqrt(2), reach, 2)  # only a cap smaller than a hemisphere is convex


def _by_size(reach: Array) -> list[NDArray[np.int64]]:
    """Triangles grouped by size, each within a factor of two, so that a large one widens no search for the small."""
    octave = np.floor(np.log2(reach)).astype(int)
    return [np.flatnonzero(octave == one) for one in np.unique(octave)]

"""Bounding-cap hierarchy over spherical triangles: point location in logarithmic time a lane."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device

_INNER = np.uint32(0xFFFFFFFF)
_SLACK = 1e-6  # a cap's radius is rounded to float32; the smallest triangles, at subdivision 5, are 3e-2 wide


@dataclass(frozen=True, eq=False)
class CapTree:
    """Bounding-volume hierarchy of spherical caps: depth-first nodes with skip links, traversed without a stack.

    Attributes
    ----------
    cap : mi.Float
        Axis x, y, z and cosine of the angular radius of each node's cap, flat.
    skip : mi.UInt32
        Node to continue at when a cap is missed: the first one after the subtree.
    triangle : mi.UInt32
        Triangle index of a leaf; all bits set in inner nodes.
    corners : mi.Float
        Corners of the triangles, nine floats each, flat.
    size : mi.UInt32
        Number of nodes (opaque, so that trees of any size share one kernel).
    """

    cap: mi.Float
    skip: mi.UInt32
    triangle: mi.UInt32
    corners: mi.Float
    size: mi.UInt32

    @classmethod
    def build(cls, corners: NDArray[np.float64]) -> CapTree:
        """Build the tree by median splits along the widest axis.

        Parameters
        ----------
        corners : ndarray, shape (M, 3, 3)
            Corners of each triangle, unit vectors, counter-clockwise seen from outside.
        """
        caps: list[NDArray[np.float64]] = []
        skips: list[int] = []
        triangles: list[int] = []
        centroids = corners.sum(axis=1)

        def add(members: NDArray[np.int64]) -> None:
            # Depth first: this node, then its two halves, then the skip link past them
            node = len(caps)
            caps.append(_cap(corners[members].reshape(-1, 3)))
            skips.append(0)
            leaf = len(members) == 1
            triangles.append(int(members[0]) if leaf else int(_INNER))
            if not leaf:
                spread = np.ptp(centroids[members], axis=0)
                order = members[np.argsort(centroids[members, int(np.argmax(spread))], kind="stable")]
                add(order[: len(order) // 2])
                add(order[len(order) // 2 :])
            skips[node] = len(caps)

        add(np.arange(len(corners)))
        return cls(
            cap=to_device(mi.Float, np.asarray(caps, dtype=np.float32)),
            skip=to_device(mi.UInt32, np.asarray(skips, dtype=np.uint32)),
            triangle=to_device(mi.UInt32, np.asarray(triangles, dtype=np.uint32)),
            corners=to_device(mi.Float, corners.astype(np.float32)),
            size=dr.opaque(mi.UInt32, len(caps)),
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
            Among the triangles visited, the one with the largest signed distance from `v` to its nearest side. A
            direction that rounding places just outside every triangle still gets a neighbouring one.
        """

        def step(node: mi.UInt32, best: mi.UInt32, depth: mi.Float) -> tuple[mi.UInt32, mi.UInt32, mi.Float]:
            cap = dr.gather(mi.Vector4f, self.cap, node)
            within = dr.dot(cap.xyz, v) >= cap.w - _SLACK
            triangle = dr.gather(mi.UInt32, self.triangle, node, within)
            is_leaf = within & (triangle != int(_INNER))
            inside = self._depth(triangle, v, is_leaf)
            deeper = is_leaf & (inside > depth)
            following = dr.gather(mi.UInt32, self.skip, node)
            node = dr.select(within, node + 1, following)
            return node, dr.select(deeper, triangle, best), dr.select(deeper, inside, depth)

        _, best, _ = dr.while_loop(
            state=(mi.UInt32(0), mi.UInt32(0), mi.Float(-dr.inf)),
            cond=lambda node, _best, _depth: node < self.size,
            body=step,
            labels=("node", "best", "depth"),
            label="locate_triangle",
        )
        return best

    def _depth(self, triangle: mi.UInt32, v: mi.Vector3f, active: mi.Bool) -> mi.Float:
        """Signed distance from `v` to the nearest side of the triangle, positive inside."""
        a, b, c = (dr.gather(mi.Vector3f, self.corners, 3 * triangle + k, active) for k in range(3))

        def distance_to_side(p: mi.Vector3f, q: mi.Vector3f) -> mi.Float:
            # det(v, p − v, q − v) has no cancellation near the side; divided by |q − p| it is the distance
            return dr.dot(v, dr.cross(p - v, q - v)) * dr.rsqrt(dr.squared_norm(q - p))

        return dr.minimum(dr.minimum(distance_to_side(a, b), distance_to_side(b, c)), distance_to_side(c, a))


def _cap(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Axis and cosine of the radius of a cap around the points and the great-circle arcs between them."""
    axis = points.mean(axis=0)
    length = np.linalg.norm(axis)
    if length < 1e-9:
        return np.array([0.0, 0.0, 1.0, -1.0])
    axis = axis / length
    cosine = float((points @ axis).min())
    return np.append(axis, cosine if cosine > 0 else -1.0)  # only a cap smaller than a hemisphere is convex

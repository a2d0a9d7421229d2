"""Views that do not surround the sphere: the triangles that they hold, and the nearest point held for the rest.

A triangle of the convex hull whose circumscribed cap is too wide is no neighbourhood: it is left out. A direction
outside all triangles is looked up at the nearest point of an edge between neighbours, so that the blend of a few views
continues, and ends at the nearest of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError
from rsibr.geometry.spherical import Weights
from rsibr.geometry.to_device import to_device

GAP_DEG = 60.0
"""Largest circumradius of a triangle that counts as covered; an icosahedron has 37.4°, an octahedron 54.7°."""

NEAR_DEG = 2.0
"""Angle from an edge between neighbours within which a direction counts as covered: a ring of views covers a band."""

_INSIDE = -1e-6  # signed distance to a side, by rounding
_COINCIDE = 1e-6

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
BarycentricWeights = Callable[["mi.Vector3f", "mi.Vector3f", "mi.Vector3f", "mi.Vector3f"], Weights]


@dataclass
class PartialSphere:
    """Stored directions on the device, and what lies between them.

    Attributes
    ----------
    directions : mi.Float
        Unit directions, three floats each, flat.
    triangles : mi.UInt32
        Indices of the directions, three each, flat; one without area stands for none.
    edges : mi.UInt32
        Indices of the ends of the edges around the triangles and between lone views, two each, flat.
    count, triangle_count, edge_count : mi.UInt32
        Their numbers (opaque).
    """

    directions: mi.Float
    triangles: mi.UInt32
    edges: mi.UInt32
    count: mi.UInt32
    triangle_count: mi.UInt32
    edge_count: mi.UInt32

    @classmethod
    def of(cls, directions: Array, triangles: Indices) -> PartialSphere:
        """Put directions and triangles on the device; see `edges_of`."""
        faces = triangles if len(triangles) else np.zeros((1, 3), dtype=np.int64)
        edges = edges_of(directions, triangles)
        return cls(
            to_device(mi.Float, directions.astype(np.float32)),
            to_device(mi.UInt32, faces.astype(np.uint32)),
            to_device(mi.UInt32, edges.astype(np.uint32)),
            *(dr.opaque(mi.UInt32, len(part)) for part in (directions, faces, edges)),
        )

    def direction(self, index: mi.UInt32) -> mi.Vector3f:
        """Stored direction of the view `index`, one a lane."""
        return dr.gather(mi.Vector3f, self.directions, index)

    def surrounding(self, v: mi.Vector3f) -> mi.Vector3u:
        """Indices of three views: of the triangle around `v`, or of the nearest edge, its second end twice."""
        triangle, depth = self._deepest(v)
        edge, _, _ = self._nearest_edge(v)
        first, second = (dr.gather(mi.UInt32, self.edges, 2 * edge + end) for end in (0, 1))
        held = dr.gather(mi.Vector3u, self.triangles, triangle)
        return dr.select(depth >= _INSIDE, held, mi.Vector3u(first, second, second))

    def held(self, v: mi.Vector3f, weights: BarycentricWeights) -> tuple[mi.Vector3u, Weights]:
        """Views of the triangle or the edge that holds `v` or is nearest to it, and their shares.

        Parameters
        ----------
        v : mi.Vector3f
            Unit directions, one a lane.
        weights : callable
            Shares inside a triangle, such as `rsibr.geometry.spherical.area_weights`.
        """
        triangle, depth = self._deepest(v)
        edge, along, _ = self._nearest_edge(v)
        inside = depth >= _INSIDE
        first, second = (dr.gather(mi.UInt32, self.edges, 2 * edge + end) for end in (0, 1))
        corners = dr.gather(mi.Vector3u, self.triangles, triangle)
        within = weights(v, *(self.direction(corner) for corner in corners))
        beside = (1 - along, along, mi.Float(0))
        shares = tuple(dr.select(inside, a, b) for a, b in zip(within, beside, strict=True))
        return dr.select(inside, corners, mi.Vector3u(first, second, second)), shares

    def nearest(self, v: mi.Vector3f) -> mi.UInt32:
        """Index of the stored view nearest to `v`; the first of several at the same distance."""
        return nearest_view(self.directions, self.count, v)

    def _deepest(self, v: mi.Vector3f) -> tuple[mi.UInt32, mi.Float]:
        """Triangle in which `v` lies deepest, and its signed distance from the nearest side."""
        triangles, directions, count = self.triangles, self.directions, self.triangle_count

        def step(place: mi.UInt32, best: mi.UInt32, depth: mi.Float) -> tuple[mi.UInt32, mi.UInt32, mi.Float]:
            corners = dr.gather(mi.Vector3u, triangles, place)
            a, b, c = (dr.gather(mi.Vector3f, directions, corner) for corner in corners)
            inside = dr.minimum(dr.minimum(_beyond(v, a, b), _beyond(v, b, c)), _beyond(v, c, a))
            inside = dr.select(dr.dot(v, a + b + c) > 0, inside, -2)  # not the triangle on the other side
            deeper = inside > depth
            return place + 1, dr.select(deeper, place, best), dr.select(deeper, inside, depth)

        _, best, depth = dr.while_loop(
            state=(mi.UInt32(0), mi.UInt32(0), mi.Float(-2)),
            cond=lambda place, _best, _depth: place < count,
            body=step,
            labels=("place", "best", "depth"),
            label="held_by_triangle",
        )
        return best, depth

    def _nearest_edge(self, v: mi.Vector3f) -> tuple[mi.UInt32, mi.Float, mi.Float]:
        """Nearest edge, the share of its length at which it is nearest, and the cosine of the distance."""
        edges, directions, count = self.edges, self.directions, self.edge_count

        def step(
            place: mi.UInt32, best: mi.UInt32, along: mi.Float, cosine: mi.Float
        ) -> tuple[mi.UInt32, mi.UInt32, mi.Float, mi.Float]:
            a, b = (dr.gather(mi.Vector3f, directions, dr.gather(mi.UInt32, edges, 2 * place + end)) for end in (0, 1))
            share, near = _on_arc(v, a, b)
            nearer = near > cosine
            kept = (dr.select(nearer, x, y) for x, y in ((place, best), (share, along), (near, cosine)))
            return place + 1, *kept

        _, best, along, cosine = dr.while_loop(
            state=(mi.UInt32(0), mi.UInt32(0), mi.Float(0), mi.Float(-2)),
            cond=lambda place, _best, _along, _cosine: place < count,
            body=step,
            labels=("place", "best", "along", "cosine"),
            label="nearest_edge",
        )
        return best, along, cosine


def nearest_view(directions: mi.Float, count: mi.UInt32, v: mi.Vector3f) -> mi.UInt32:
    """Index of the direction nearest to `v`, the first of several at the same distance.

    Parameters
    ----------
    directions : mi.Float
        Unit directions, three floats each, flat.
    count : mi.UInt32
        Their number.
    v : mi.Vector3f
        Unit directions, one a lane.
    """
    best, best_cosine, candidate = mi.UInt32(0), mi.Float(-2), mi.UInt32(0)

    def step(candidate: mi.UInt32, best: mi.UInt32, best_cosine: mi.Float) -> tuple[mi.UInt32, mi.UInt32, mi.Float]:
        cosine = dr.dot(v, dr.gather(mi.Vector3f, directions, candidate))
        nearer = cosine > best_cosine
        best = dr.select(nearer, candidate, best)
        return candidate + 1, best, dr.maximum(cosine, best_cosine)

    _, best, _ = dr.while_loop(
        state=(candidate, best, best_cosine),
        cond=lambda candidate, _best, _cosine: candidate < count,
        body=step,
        labels=("candidate", "best", "best_cosine"),
        label="nearest_view",
    )
    return best


def _beyond(v: mi.Vector3f, p: mi.Vector3f, q: mi.Vector3f) -> mi.Float:
    """Signed distance of `v` from the side from p to q; −2 for a side without length."""
    length = dr.squared_norm(q - p)
    return dr.select(length > 1e-12, dr.dot(v, dr.cross(p - v, q - v)) * dr.rsqrt(dr.maximum(length, 1e-12)), -2)


def _on_arc(v: mi.Vector3f, a: mi.Vector3f, b: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Share of the arc from a to b at its point nearest to `v`, and the cosine between the two."""
    axis = dr.cross(a, b)
    size = dr.norm(axis)
    axis = axis / dr.maximum(size, 1e-12)
    side = dr.cross(axis, a)
    turn, whole = dr.atan2(dr.dot(v, side), dr.dot(v, a)), dr.atan2(size, dr.dot(a, b))
    at_a, at_b = dr.dot(v, a), dr.dot(v, b)
    on = (turn > 0) & (turn < whole) & (size > _COINCIDE)
    share = dr.select(on, turn / dr.maximum(whole, 1e-12), dr.select(at_a >= at_b, mi.Float(0), mi.Float(1)))
    return share, dr.select(on, dr.hypot(dr.dot(v, side), at_a), dr.maximum(at_a, at_b))


def neighbourhoods(directions: Array, gap_deg: float = GAP_DEG) -> Indices:
    """Triangles of neighbouring directions, counter-clockwise seen from outside; shape (M, 3), possibly none.

    Parameters
    ----------
    directions : ndarray, shape (V, 3)
        Unit directions.
    gap_deg : float
        Largest circumradius [degrees].

    Notes
    -----
    The faces of the convex hull are the Delaunay triangles of the sphere: no other direction lies in the circumscribed
    cap of one. Its axis is the face's normal n, and its radius arccos(n·a).
    """
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415  # only this function needs it

    try:
        hull = ConvexHull(directions)
        faces, depth = np.asarray(hull.simplices, dtype=np.int64), -hull.equations[:, 3]
    except (QhullError, ValueError):
        faces, depth = _flat(directions)
    faces = faces[depth > np.cos(np.radians(gap_deg)) - 1e-9]
    turned = np.linalg.det(directions[faces]) < 0
    faces[turned] = faces[turned][:, ::-1]
    return np.asarray(faces)


def _flat(directions: Array) -> tuple[Indices, Array]:
    """Triangles of directions that lie in one plane: a fan, with the distance of the plane."""
    count = len(directions)
    middle = directions.mean(axis=0)
    if count < 3:
        return np.zeros((0, 3), dtype=np.int64), np.zeros(0)
    normal = np.linalg.svd(directions - middle)[2][2]
    normal = normal if normal @ middle >= 0 else -normal
    side = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.9 else [0, 1.0, 0])
    order = np.argsort(np.arctan2(directions @ np.cross(normal, side), directions @ side))
    fan = np.array([[order[0], order[k], order[k + 1]] for k in range(1, count - 1)], dtype=np.int64)
    return fan, np.full(len(fan), float(normal @ middle))


def circumradii(corners: Array) -> Array:
    """Radii [rad] of the caps around spherical triangles, shape (M, 3, 3) to (M,)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal: Array = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return np.asarray(np.arccos(np.clip((normal * a).sum(axis=1), -1, 1)))


def edges_of(directions: Array, triangles: Indices, gap_deg: float = GAP_DEG) -> Indices:
    """Edges to which directions outside all triangles are drawn, shape (E, 2).

    The sides of only one triangle; and for views of no triangle those to their neighbours in the Gabriel graph: no
    other view lies in the cap whose diameter the edge is. A view without any is an edge to itself.
    """
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, number = np.unique(sides, axis=0, return_counts=True) if len(sides) else (sides, np.zeros(0))
    lone = np.setdiff1d(np.arange(len(directions)), triangles)
    found = [tuple(side) for side in unique[number == 1].tolist()]
    longest = 2 * np.sin(np.radians(min(gap_deg, 90.0)))
    for i in lone.tolist():
        chord = directions - directions[i]
        for j in np.flatnonzero(np.linalg.norm(chord, axis=1) <= longest + 1e-9).tolist():
            between = ((directions - directions[i]) * (directions - directions[j])).sum(axis=1) < -1e-12
            if j != i and not between.any():
                found.append((min(i, j), max(i, j)))
    reached = {end for edge in found for end in edge}
    found += [(i, i) for i in lone.tolist() if i not in reached]
    return np.array(sorted(set(found)), dtype=np.int64).reshape(-1, 2)


def check_triangles(directions: Array, triangles: ArrayLike) -> Indices:
    """Triangles that need not cover the sphere, checked.

    Raises
    ------
    InputError
        If an index is out of range, a triangle is flat or clockwise seen from outside, or a side has three triangles.
    """
    faces = np.array(triangles, dtype=np.int64).reshape(-1, 3)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(directions)):
        raise InputError("a triangle names a direction that is not there", where="views")
    if (np.linalg.det(directions[faces]) <= 0).any():
        raise InputError("a triangle is flat, or clockwise seen from outside", where="views")
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    if len(np.unique(sides, axis=0)) < len(sides):
        raise InputError("two triangles overlap at a side", where="views")
    return faces


def covers(directions: Array, triangles: Indices, views: Array) -> NDArray[np.bool_]:
    """Whether directions lie in a triangle, or within `NEAR_DEG` of an edge between neighbours; shape (n,)."""
    inside = np.zeros(len(views), dtype=np.bool_)
    for a, b, c in directions[triangles]:
        inside |= (
            (views @ np.cross(a, b) >= _INSIDE)
            & (views @ np.cross(b, c) >= _INSIDE)
            & (views @ np.cross(c, a) >= _INSIDE)
        )
    least = np.cos(np.radians(NEAR_DEG))
    for a, b in directions[edges_of(directions, triangles)]:
        axis = np.cross(a, b)
        size = float(np.linalg.norm(axis))
        ends = np.maximum(views @ a, views @ b)
        if size > _COINCIDE:
            side = np.cross(axis / size, a)
            turn = np.arctan2(views @ side, views @ a)
            on = (turn > 0) & (turn < np.arctan2(size, a @ b))
            ends = np.where(on, np.hypot(views @ side, views @ a), ends)
        inside |= ends >= least
    return inside

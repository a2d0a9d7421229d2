"""Points of the surface at which irradiance is gathered: vertices of fine meshes, grids in triangles of coarse ones.

Shapes that are not meshes (spheres, disks, cylinders) have the square of their parameters cut into two triangles.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.shading.occlusion.triangle_grid import grid_corners, grid_places

Array = NDArray[np.float64]

SPACING = 0.02
"""Distance between points over the radius of the scene that a coarse mesh is refined to."""

MOST_REFINED = 2**16
"""Points of a scene up to which coarse meshes are refined."""

MOST_STEPS = 96
"""Steps along an edge of a triangle, at most."""

_INWARD = 2e-3  # how far the points of flat triangles move to the middle, off the edges where two faces meet


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of all shapes with a bake.

    Attributes
    ----------
    positions, normals : ndarray, shape (N, 3), float32
        World coordinates; unit normals.
    corners : ndarray, shape (F, 3), uint32
        Points of each small triangle, those of all shapes in one list.
    first_triangle, first_point, steps : dict of str to int
        By shape id: first row in `corners`; first point; steps along an edge of its triangles, see `triangle_grid`.
        Shapes without points are absent.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    corners: NDArray[np.uint32]
    first_triangle: dict[str, int]
    first_point: dict[str, int]
    steps: dict[str, int]

    @classmethod
    def of(cls, shapes: Mapping[str, Any], names: Iterable[str], radius: float) -> SurfacePoints:
        """Choose the points of the shapes `names` in a scene of a radius."""
        positions, normals, corners = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3), np.uint32)]
        first_triangle, first_point, steps = dict[str, int](), dict[str, int](), dict[str, int]()
        chosen = list(names)
        points, triangles, most = 0, 0, MOST_REFINED // max(len(chosen), 1)
        for name in chosen:
            found = _points_of(shapes[name], SPACING * radius, most)
            if found is None:
                continue
            where, n, faces, steps[name] = found
            first_triangle[name], first_point[name] = triangles, points
            positions.append(where)
            normals.append(n)
            corners.append(faces + np.uint32(points))
            points, triangles = points + len(where), triangles + len(faces)
        at, up = (np.asarray(np.concatenate(part), np.float32) for part in (positions, normals))
        return cls(at, up, np.concatenate(corners).astype(np.uint32), first_triangle, first_point, steps)

    def __len__(self) -> int:
        return len(self.positions)

    def rows(self) -> Iterator[tuple[str, slice]]:
        """Points of each shape, as a slice."""
        ends = [*list(self.first_point.values())[1:], len(self)]
        for (name, start), end in zip(self.first_point.items(), ends, strict=True):
            yield name, slice(start, end)


_Points = tuple[Array, Array, NDArray[np.uint32], int]
"""Positions, normals, points of each small triangle, steps along an edge."""


def _points_of(shape: Any, spacing: float, most: int) -> _Points | None:
    if not isinstance(shape, mi.Mesh):
        return _on_square(shape, most)
    if not shape.face_count():
        return None
    parameters = mi.traverse(shape)
    if "vertex_positions" not in parameters:  # `rectangle` is a mesh without them
        return _on_square(shape, most)
    positions = np.array(parameters["vertex_positions"], np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], np.uint32).reshape(-1, 3)
    positions = np.where(np.isfinite(positions), positions, 0)
    triangles = positions[faces]
    flat = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    steps = _steps(triangles, flat, spacing, most)
    if not shape.has_vertex_normals() or shape.has_face_normals():
        inside = triangles + _INWARD * (triangles.mean(axis=1, keepdims=True) - triangles)
        return _refined(inside, np.repeat(_unit(flat)[:, None], 3, axis=1), steps)
    given = np.array(parameters["vertex_normals"], np.float64).reshape(-1, 3)
    normals = _safe_normals(given, flat, faces)
    if steps == 1:
        return positions, normals, faces, 1
    return _refined(triangles, normals[faces], steps)


def _steps(triangles: Array, flat: Array, spacing: float, most: int) -> int:
    """Steps along an edge that bring points to a spacing, on average over the area, with so many points at most."""
    area = np.linalg.norm(flat, axis=1)
    edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    edge = float((area * edges).sum() / max(area.sum(), 1e-300))
    wanted = math.ceil(min(edge / max(spacing, 1e-300), MOST_STEPS) - 1e-6)
    return max(1, min(wanted, _steps_within(most / len(triangles))))


def _steps_within(points: float) -> int:
    """Most steps with (s + 1)(s + 2)/2 points or fewer."""
    return max(1, math.floor(math.sqrt(2 * points + 0.25) - 1.5))


def _refined(triangles: Array, normals: Array, steps: int) -> _Points:
    """Points on a grid in each triangle, (F, 3, 3); normals are interpolated."""
    place = grid_places(steps)
    weights = np.stack([1 - place.sum(axis=1), place[:, 0], place[:, 1]], axis=1)
    where = np.einsum("gk,fkc->fgc", weights, triangles)
    n = np.einsum("gk,fkc->fgc", weights, normals)
    first = np.arange(len(triangles), dtype=np.uint32)[:, None, None] * np.uint32(len(place))
    corners = (first + grid_corners(steps)[None]).reshape(-1, 3)
    return where.reshape(-1, 3), _unit(n.reshape(-1, 3)), corners, steps


def _on_square(shape: Any, most: int) -> _Points | None:
    """Points over the square of the parameters (u, v), as two triangles; None for a shape without parameters."""
    steps = min(MOST_STEPS, _steps_within(most / 2))
    lower = grid_places(steps)
    uv = np.concatenate([lower, 1 - lower])
    inner = np.clip(uv, 1e-4, 1 - 1e-4)  # poles and seams have no normal
    try:
        at = shape.eval_parameterization(mi.Point2f(*inner.T.astype(np.float32)))
    except (RuntimeError, NotImplementedError):
        return None
    where, n = (np.array(rows, np.float64).reshape(3, -1).T for rows in (at.p, at.n))
    if len(where) != len(uv) or not np.isfinite(where).all():
        return None
    corners = grid_corners(steps)
    both = np.concatenate([corners, corners + np.uint32(len(lower))])
    return where, _unit(np.broadcast_to(n, where.shape)), both, steps


def _safe_normals(given: Array, flat: Array, faces: NDArray[np.uint32]) -> Array:
    """Unit vertex normals; zero and NaN ones are replaced by those of the adjacent faces, by area."""
    length = np.linalg.norm(given, axis=1)
    bad = ~(np.isfinite(length) & (length > 0.1))
    if bad.any():
        summed = np.zeros_like(given)
        np.add.at(summed, faces.ravel(), np.repeat(flat, 3, axis=0))
        given = np.where(bad[:, None], summed, given)
    return _unit(given)


def _unit(vectors: Array) -> Array:
    """Unit vectors; +z where there is no direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    good = np.isfinite(length) & (length > 1e-30)
    return np.where(good, vectors / np.where(good, length, 1), [0.0, 0.0, 1.0])

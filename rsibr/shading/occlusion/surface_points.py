"""Points of the surface at which irradiance is gathered: the vertices of meshes, and where each triangle finds them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.shading.surfaces import Surfaces

NO_POINTS = 2**32 - 1
"""Offset of a shape without points."""

_INWARD = 0.02  # how far corners of flat triangles move to the middle, off the edges where two faces meet


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of all meshes of a scene.

    Attributes
    ----------
    positions, normals : ndarray, shape (N, 3), float32
        World coordinates; unit normals.
    corners : ndarray, shape (F, 3), uint32
        Points of each triangle, those of all meshes in one list.
    first_triangle, first_point : dict of str to int
        Row of a shape's first triangle in `corners`, and of its first point, by shape id. Shapes that are not meshes
        are absent.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    corners: NDArray[np.uint32]
    first_triangle: dict[str, int]
    first_point: dict[str, int]

    @classmethod
    def of(cls, shapes: Mapping[str, Any], names: Iterable[str]) -> SurfacePoints:
        """Collect the points of those of the shapes `names` that are meshes."""
        positions, normals, corners = [np.zeros((0, 3), np.float32)], [np.zeros((0, 3), np.float32)], []
        first, first_point, points, triangles = dict[str, int](), dict[str, int](), 0, 0
        for name in names:
            if not isinstance(shapes[name], mi.Mesh) or not shapes[name].face_count():
                continue
            where, n, faces = _points_of(shapes[name])
            first[name], first_point[name] = triangles, points
            positions.append(where)
            normals.append(n)
            corners.append(faces + np.uint32(points))
            points, triangles = points + len(where), triangles + len(faces)
        whole = np.concatenate([np.zeros((0, 3), np.uint32), *corners])
        return cls(np.concatenate(positions), np.concatenate(normals), whole, first, first_point)

    def __len__(self) -> int:
        return len(self.positions)

    def rows(self) -> Iterator[tuple[str, slice]]:
        """Points of each shape, as a slice."""
        ends = [*list(self.first_point.values())[1:], len(self)]
        for (name, start), end in zip(self.first_point.items(), ends, strict=True):
            yield name, slice(start, end)


def _points_of(mesh: mi.Mesh) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint32]]:
    """Positions, unit normals, and the points of each triangle: its vertices, or three of its own if it is flat."""
    parameters = mi.traverse(mesh)
    positions = np.array(parameters["vertex_positions"], np.float32).reshape(-1, 3)
    faces = np.array(parameters["faces"], np.uint32).reshape(-1, 3)
    positions = np.where(np.isfinite(positions), positions, 0).astype(np.float32)
    triangles = positions[faces].astype(np.float64)
    flat = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    if mesh.has_vertex_normals() and not mesh.has_face_normals():
        given = np.array(parameters["vertex_normals"], np.float64).reshape(-1, 3)
        return positions, _safe_normals(given, flat, faces), faces
    middle = triangles.mean(axis=1, keepdims=True)
    inside = (triangles + _INWARD * (middle - triangles)).reshape(-1, 3)
    n = np.repeat(_unit(flat), 3, axis=0)
    return inside.astype(np.float32), n.astype(np.float32), np.arange(len(inside), dtype=np.uint32).reshape(-1, 3)


def _safe_normals(given: NDArray[np.float64], flat: NDArray[np.float64], faces: NDArray[np.uint32]) -> Any:
    """Unit vertex normals; zero and NaN ones are replaced by those of the adjacent faces, by area."""
    length = np.linalg.norm(given, axis=1)
    bad = ~(np.isfinite(length) & (length > 0.1))
    if bad.any():
        summed = np.zeros_like(given)
        np.add.at(summed, faces.ravel(), np.repeat(np.nan_to_num(flat), 3, axis=0))
        given = np.where(bad[:, None], summed, given)
    return _unit(given).astype(np.float32)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors; +z where there is no direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    good = np.isfinite(length) & (length > 1e-30)
    return np.where(good, vectors / np.where(good, length, 1), [0.0, 0.0, 1.0])


@dataclass(eq=False)
class PointField:
    """Colours at the points of the surface, interpolated linearly in each triangle.

    Attributes
    ----------
    offsets : mi.UInt32
        First triangle of each shape by its number in Mitsuba's registry; `NO_POINTS` if it has none.
    corners : mi.UInt32
        Points of each triangle, flat.
    values : mi.Float
        Four floats a point, flat; the fourth is not used.
    """

    offsets: mi.UInt32
    corners: mi.UInt32
    values: mi.Float

    @classmethod
    def of(cls, points: SurfacePoints, shapes: Mapping[str, Any]) -> PointField:
        """Field with the value 1 everywhere."""
        numbers = {name: int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for name, shape in shapes.items()}
        offsets = np.full(max(numbers.values()) + 1, NO_POINTS, np.uint32)
        for name, first in points.first_triangle.items():
            offsets[numbers[name]] = first
        corners = points.corners if len(points.corners) else np.zeros((1, 3), np.uint32)
        ones = np.ones((max(len(points), 1), 4), np.float32)
        return cls(to_device(mi.UInt32, offsets), to_device(mi.UInt32, corners), to_device(mi.Float, ones))

    def holding(self, values: NDArray[np.float32]) -> PointField:
        """Field with the same points and other values, shape (N, 3)."""
        padded = np.zeros((max(len(values), 1), 4), np.float32)
        padded[: len(values), :3] = values
        return PointField(self.offsets, self.corners, to_device(mi.Float, padded))

    def at(
        self, shape: mi.UInt32, triangle: mi.UInt32, barycentric: mi.Point2f, active: mi.Bool, otherwise: float
    ) -> mi.Color3f:
        """Value at a place of a triangle; `otherwise` on shapes without points and in inactive lanes.

        Parameters
        ----------
        shape, triangle, barycentric
            See `Surfaces`.
        active : mi.Bool
            Lanes with a surface.
        otherwise : float
            Value elsewhere.
        """
        first = dr.gather(mi.UInt32, self.offsets, shape, active)
        there = active & (first != NO_POINTS)
        x, y, z = (dr.gather(mi.UInt32, self.corners, 3 * (first + triangle) + k, there) for k in range(3))
        a, b, c = (dr.gather(mi.Vector4f, self.values, point, there) for point in (x, y, z))
        mixed = a * (1 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y
        return dr.select(there, mi.Color3f(mixed.x, mixed.y, mixed.z), otherwise)

    def on(self, surfaces: Surfaces, otherwise: float) -> mi.Color3f:
        """Value at surfaces that are seen from the side of their normals; `otherwise` on the other side."""
        outer = surfaces.hit & (surfaces.flipped == surfaces.is_back)
        return self.at(surfaces.shape, surfaces.triangle, surfaces.barycentric, outer, otherwise)

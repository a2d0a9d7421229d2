"""Colours at the points of the surface, interpolated between them where a ray meets it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.shading.occlusion.surface_points import SurfacePoints
from rsibr.shading.occlusion.triangle_grid import small_triangle
from rsibr.shading.surfaces import Surfaces

_MESH, _SQUARE = 1, 2  # kinds of shapes with points


@dataclass
class Place:
    """Place on a shape, one a lane.

    Attributes
    ----------
    shape : mi.UInt32
        Number in Mitsuba's registry.
    triangle : mi.UInt32
        Number of the triangle in its mesh.
    within : mi.Point2f
        Weights of its second and third vertex; parameters (u, v) on a shape that is not a mesh.
    """

    shape: mi.UInt32
    triangle: mi.UInt32
    within: mi.Point2f


@dataclass(eq=False)
class PointField:
    """Colours at the points of the surface.

    Attributes
    ----------
    shapes : mi.UInt32
        Kind, first small triangle, steps along an edge and nothing, four numbers a shape, by its number in Mitsuba's
        registry, flat; kind 0 has no points.
    corners : mi.UInt32
        Points of each small triangle, flat.
    values : mi.Float
        Four floats a point, flat; the fourth is not used.
    has_squares : bool
        Whether a shape is not a mesh.
    """

    shapes: mi.UInt32
    corners: mi.UInt32
    values: mi.Float
    has_squares: bool

    @classmethod
    def of(cls, points: SurfacePoints, shapes: Mapping[str, Any]) -> PointField:
        """Field with the value 1 everywhere."""
        numbers = {name: int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for name, shape in shapes.items()}
        table = np.zeros((max(numbers.values()) + 1, 4), np.uint32)
        squares = [name for name in points.steps if not isinstance(shapes[name], mi.Mesh)]
        for name, steps in points.steps.items():
            kind = _SQUARE if name in squares else _MESH
            table[numbers[name]] = kind, points.first_triangle[name], steps, 0
        corners = points.corners if len(points.corners) else np.zeros((1, 3), np.uint32)
        ones = np.ones((max(len(points), 1), 4), np.float32)
        on_device = to_device(mi.UInt32, table), to_device(mi.UInt32, corners), to_device(mi.Float, ones)
        return cls(*on_device, bool(squares))

    def holding(self, values: NDArray[np.float32]) -> PointField:
        """Field with the same points and other values, shape (N, 3)."""
        padded = np.zeros((max(len(values), 1), 4), np.float32)
        padded[: len(values), :3] = values
        return PointField(self.shapes, self.corners, to_device(mi.Float, padded), self.has_squares)

    def on(self, surfaces: Surfaces, otherwise: float) -> mi.Color3f:
        """Value at surfaces seen from the side of their normals; `otherwise` on the other side, and without points."""
        outer = surfaces.hit & (surfaces.flipped == surfaces.is_back)
        return self._at(Place(surfaces.shape, surfaces.triangle, surfaces.barycentric), outer, otherwise)

    def met(self, ray: mi.Ray3f, found: mi.PreliminaryIntersection3f, active: mi.Bool) -> mi.Color3f:
        """Value where rays meet the surface; 0 where they do not, and without points."""
        hit = active & found.is_valid()
        within = found.prim_uv
        if self.has_squares:
            within = dr.select(
                found.shape.is_mesh(), within, found.compute_surface_interaction(ray, mi.RayFlags.All, hit).uv
            )
        return self._at(Place(dr.reinterpret_array(mi.UInt32, found.shape), found.prim_index, within), hit, 0)

    def _at(self, place: Place, active: mi.Bool, otherwise: float) -> mi.Color3f:
        kind, first, steps, _ = (dr.gather(mi.UInt32, self.shapes, 4 * place.shape + k, active) for k in range(4))
        there, triangle, within = active & (kind != 0), place.triangle, place.within
        if self.has_squares:
            # ---- The square of the parameters is two triangles ----
            is_square, is_beyond = kind == _SQUARE, within.x + within.y > 1
            triangle = dr.select(is_square, dr.select(is_beyond, mi.UInt32(1), 0), triangle)
            within = dr.select(is_square & is_beyond, 1 - within, within)
        steps = dr.maximum(steps, 1)
        number, inside = small_triangle(within, steps)
        row = first + triangle * steps * steps + number
        x, y, z = (dr.gather(mi.UInt32, self.corners, 3 * row + k, there) for k in range(3))
        a, b, c = (dr.gather(mi.Vector4f, self.values, point, there) for point in (x, y, z))
        mixed = a * (1 - inside.x - inside.y) + b * inside.x + c * inside.y
        return dr.select(there, mi.Color3f(mixed.x, mixed.y, mixed.z), otherwise)

"""Rays through the corners of a ray's share of the pixel: they find its `Footprint`."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

from rsibr.shading.cameras.camera import CameraRays
from rsibr.shading.footprint import Footprint
from rsibr.shading.surfaces import LEAST_COSINE, Surfaces, above_horizon, first_surfaces

CORNERS = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
"""Places of the corners in units of the share's side: top left, top right, bottom right, bottom left."""

_FARTHEST = 3.0  # of a corner's hit from the ray's, in units of the share's length on the tangent plane
_LEAST_SLANT = 0.02  # cosine of the tangent plane below which that length grows no more


def corner_rays(camera: CameraRays, place: mi.Point2f, side: mi.Float) -> list[mi.Ray3f]:
    """Rays through the corners of the share of a pixel around each ray.

    Parameters
    ----------
    camera : CameraRays
        Camera.
    place : mi.Point2f
        Places of the rays in the picture [pixels].
    side : mi.Float
        Side of a ray's share [pixels].
    """
    return [camera.ray(place + side * mi.Point2f(*corner)) for corner in CORNERS]


def corners_of_differentials(ray: mi.RayDifferential3f) -> list[mi.Ray3f]:
    """Rays through the corners of a ray's share of the pixel, from its differentials.

    Mitsuba scales them to the share of a sample: one side of it to the right (x), and one down (y).
    """
    across, down = ray.d_x - ray.d, ray.d_y - ray.d
    shifted, sunk = ray.o_x - ray.o, ray.o_y - ray.o
    return [
        mi.Ray3f(ray.o + x * shifted + y * sunk, dr.normalize(ray.d + x * across + y * down), ray.time, ray.wavelengths)
        for x, y in CORNERS
    ]


def footprint(geometry: mi.Scene, rays: Sequence[mi.Ray3f], at: Surfaces) -> Footprint:
    """Trace the corners of the share of a pixel around each ray.

    Parameters
    ----------
    geometry : mi.Scene
        Shapes.
    rays : sequence of mi.Ray3f
        Rays through the corners, in the order of `CORNERS`.
    at : Surfaces
        What the rays in the middle meet.

    Notes
    -----
    A corner counts if it meets the same shape, no farther away than the tangent plane suggests; elsewhere it lies
    beyond a silhouette. There the normal of the opposite corner is continued through that of the ray, and if both miss,
    the normal of the ray stands for all: the footprint shrinks to what is known.
    """
    met = [first_surfaces(geometry, ray, at.hit) for ray in rays]
    known = [_is_same(at, one) for one in met]
    normals = []
    for k, ray in enumerate(rays):
        opposite = (k + 2) % 4
        continued = dr.select(known[opposite], _continued(at.n, met[opposite].n, -ray.d), at.n)
        normals.append(dr.select(known[k], met[k].n, continued))
    return Footprint(normals, [-ray.d for ray in rays], at.hit & ~(known[0] & known[1] & known[2] & known[3]))


def _is_same(at: Surfaces, corner: Surfaces) -> mi.Bool:
    """Whether a corner sees the surface that the ray sees."""
    apart = at.distance * dr.norm(corner.v - at.v) / dr.maximum(dr.dot(at.facing, at.v), _LEAST_SLANT)
    near = dr.norm(corner.p - at.p) < _FARTHEST * apart
    return corner.hit & (corner.shape == at.shape) & (corner.is_back == at.is_back) & near


def _continued(n: mi.Vector3f, opposite: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
    """Mirror image of the normal of the opposite corner at `n`, above the horizon of the corner's own view."""
    mirrored = 2 * dr.dot(n, opposite) * n - opposite
    return dr.select(dr.dot(mirrored, v) < LEAST_COSINE, above_horizon(mirrored, v), mirrored)

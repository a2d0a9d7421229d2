"""First surfaces that rays meet, with normals that are safe to shade.

Shading normals of meshes are interpolated: near a silhouette they may face away from the viewer, and files hold zero
and NaN normals. A method evaluated there gives the radiance of its rim, or NaN, without a word.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.shading.footprint import Footprint

LEAST_COSINE = 1e-3
"""Least cosine between a shading normal and the viewer; normals that face away are bent to it."""

_LEAST_LENGTH = 0.1  # of a shading normal before normalisation; below, it is no direction


@dataclass
class Surfaces:
    """First surfaces along rays, one a lane.

    Attributes
    ----------
    hit : mi.Bool
        Whether the ray meets a surface; the other values are undefined if not.
    p : mi.Point3f
        Position.
    n : mi.Vector3f
        Shading normal made safe: a unit vector with n·v ≥ `LEAST_COSINE`.
    facing : mi.Vector3f
        Geometric normal, turned toward the viewer.
    v : mi.Vector3f
        Unit direction to the viewer.
    distance : mi.Float
        From the origin of the ray.
    shape : mi.UInt32
        Number of the shape in Mitsuba's registry; see `SurfaceTypes`.
    triangle : mi.UInt32
        Number of the triangle in its mesh.
    barycentric : mi.Point2f
        Place in the triangle: weights of its second and third vertex; on a shape that is not a mesh, its parameters
        (u, v).
    replaced, flipped, bent : mi.Bool
        Whether the shading normal was no direction; faced against the geometric normal; or faced away from the viewer.
    is_back : mi.Bool
        Whether the viewer is on the inner side of the surface.
    footprint : Footprint or None
        Corners of the share of the pixel; None unless the film traces them, for lookups with `needs_footprint`.
    """

    hit: mi.Bool
    p: mi.Point3f
    n: mi.Vector3f
    facing: mi.Vector3f
    v: mi.Vector3f
    distance: mi.Float
    shape: mi.UInt32
    triangle: mi.UInt32
    barycentric: mi.Point2f
    replaced: mi.Bool
    flipped: mi.Bool
    bent: mi.Bool
    is_back: mi.Bool
    footprint: Footprint | None = None


def first_surfaces(scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool | bool = True) -> Surfaces:
    """Trace rays to the first surfaces, and make their normals safe.

    Parameters
    ----------
    scene : mi.Scene
        Shapes.
    ray : mi.Ray3f
        One a lane.
    active : mi.Bool
        Lanes to trace.
    """
    return surfaces_at(first_hits(scene, ray, active), ray)


def first_hits(scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool | bool = True) -> mi.PreliminaryIntersection3f:
    """Trace rays to the first surfaces, of which `surfaces_at` tells more; parameters as of `first_surfaces`."""
    return scene.ray_intersect_preliminary(ray, coherent=True, active=mi.Bool(active))


def surfaces_at(found: mi.PreliminaryIntersection3f, ray: mi.Ray3f) -> Surfaces:
    """Surfaces at intersections that have been found along rays; see `first_surfaces`."""
    at = found.compute_surface_interaction(ray, mi.RayFlags.All | mi.RayFlags.dNSdUV, found.is_valid())
    hit, v = found.is_valid(), -ray.d
    # ---- Geometric normal toward the viewer ----
    is_back = dr.dot(at.n, v) < 0
    facing = dr.select(is_back, -at.n, at.n)
    # ---- Shading normal: a direction, on the viewer's side of the surface, above the horizon ----
    shading = mi.Vector3f(at.sh_frame.n)
    length = dr.norm(shading)
    replaced = hit & ~(dr.isfinite(length) & (length > _LEAST_LENGTH))
    n = dr.select(replaced, facing, shading * dr.rcp(length))
    flipped = hit & (dr.dot(n, at.n) < 0)
    n = dr.select(dr.dot(n, facing) < 0, -n, n)
    bent = hit & (dr.dot(n, v) < LEAST_COSINE)
    n = dr.select(bent, above_horizon(n, v), n)
    return Surfaces(
        hit=hit,
        p=at.p,
        n=n,
        facing=facing,
        v=v,
        distance=at.t,
        shape=dr.reinterpret_array(mi.UInt32, at.shape),
        triangle=found.prim_index,
        barycentric=dr.select(at.shape.is_mesh(), found.prim_uv, at.uv),
        replaced=replaced,
        flipped=flipped,
        bent=bent,
        is_back=hit & is_back,
    )


def above_horizon(n: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
    """Bend unit normals that face away from `v` to a cosine of `LEAST_COSINE`, in the plane of both."""
    along = n - v * dr.dot(n, v)
    squared = dr.squared_norm(along)
    any_tangent = mi.Vector3f(mi.coordinate_system(v)[0])  # n = −v has no plane
    along = dr.select(squared > 1e-8, along * dr.rsqrt(dr.maximum(squared, 1e-8)), any_tangent)
    return along * (1 - LEAST_COSINE**2) ** 0.5 + v * LEAST_COSINE

"""Estimators of the light that surfaces send to the camera, one sample a lane, by Mitsuba's own integrators.

Open shading is that of a sphere: a unit sphere under the environment is hit where its normal is the surface's, from the
surface's view direction. A sphere is convex, so that nothing is hidden and no light bounces, and Mitsuba's `direct`
integrates BSDF times environment with multiple importance sampling of both, delta lobes and delta lights included. It
shares no code with the bake. The normal at the hit is within 1e-5 of that asked for at cosines above 0.03, and within
2e-4 at 1e-3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import drjit as dr
import mitsuba as mi

from rsibr import backend
from rsibr.baking.scene import Scene
from rsibr.geometry.to_device import to_device
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.surfaces import Surfaces, above_horizon

Estimator = Callable[["mi.Ray3f", "Surfaces", "mi.UInt32", "mi.Sampler"], "mi.Color3f"]
"""(primary ray, first surface, its type, sampler) → unbiased estimate of the radiance toward the camera."""

Integrator = Literal["direct", "path"]

_AWAY = 2.0  # origin of a ray from the point that it hits, in radii


def open_spheres(prepared: Sequence[Scene]) -> list[mi.Scene]:
    """Sphere with the material of each type, under its environment."""
    made = {id(scene): _sphere(scene) for scene in prepared}
    return [made[id(scene)] for scene in prepared]


def open_shading(spheres: Sequence[mi.Scene]) -> Estimator:
    """Estimator of open shading: safe normal, own view, nothing hidden."""

    def radiance(_: mi.Ray3f, surfaces: Surfaces, kind: mi.UInt32, sampler: mi.Sampler) -> mi.Color3f:
        return _of_spheres(spheres, surfaces.n, surfaces.v, kind, sampler)

    return radiance


def one_map(spheres: Sequence[mi.Scene], camera: Camera, warps: Sequence[str]) -> Estimator:
    """Estimator of what one exact map for the camera's central direction gives: the error of perspective alone.

    Parameters
    ----------
    spheres : sequence of mi.Scene
        See `open_spheres`.
    camera : Camera
        Camera.
    warps : sequence of {"mirror", "normal"}
        Direction by which the map of each type is indexed, see `rsibr.scene.material.Material`.
    """
    backward = to_device(mi.Float, camera.axes[:, 2].astype("float32"))

    def radiance(_: mi.Ray3f, surfaces: Surfaces, kind: mi.UInt32, sampler: mi.Sampler) -> mi.Color3f:
        v = mi.Vector3f(*(dr.gather(mi.Float, backward, axis) for axis in range(3)))
        mirrored = 2 * dr.dot(surfaces.n, surfaces.v) * surfaces.n - surfaces.v
        half = dr.normalize(mirrored + v + 1e-6 * surfaces.n)  # the rim's direction has no half vector
        total = mi.Color3f(0)
        for index, warp in enumerate(warps):
            n = half if warp == "mirror" else surfaces.n
            n = dr.select(dr.dot(n, v) < 1e-3, above_horizon(n, v), n)
            total += _of_sphere(spheres[index], n, v, kind == index, sampler)
        return total

    return radiance


def traced(lit: mi.Scene, integrator: Integrator, types: int) -> Estimator:
    """Estimator in the complete scene: `direct` with shadows and without bounces, `path` with both."""
    made = _integrator(integrator)

    def radiance(ray: mi.Ray3f, _: Surfaces, kind: mi.UInt32, sampler: mi.Sampler) -> mi.Color3f:
        wanted = kind < types
        found, *_ = made.sample(lit, sampler, mi.RayDifferential3f(ray), None, wanted)
        return dr.select(wanted, mi.Color3f(found), 0)

    return radiance


def _sphere(scene: Scene) -> mi.Scene:
    sphere = {"type": "sphere", "material": scene.material.bsdf()}
    return backend.load({"type": "scene", "sphere": sphere, "environment": scene.environment.emitter()})


def _integrator(kind: Integrator) -> mi.SamplingIntegrator:
    return backend.load({"type": kind, "hide_emitters": True})


def _of_spheres(
    spheres: Sequence[mi.Scene], n: mi.Vector3f, v: mi.Vector3f, kind: mi.UInt32, sampler: mi.Sampler
) -> mi.Color3f:
    total = mi.Color3f(0)
    for index, sphere in enumerate(spheres):
        total += _of_sphere(sphere, n, v, kind == index, sampler)
    return total


def _of_sphere(sphere: mi.Scene, n: mi.Vector3f, v: mi.Vector3f, wanted: mi.Bool, sampler: mi.Sampler) -> mi.Color3f:
    ray = mi.RayDifferential3f(mi.Point3f(n + _AWAY * v), -v)
    found, *_ = _integrator("direct").sample(sphere, sampler, ray, None, wanted)
    return dr.select(wanted, mi.Color3f(found), 0)

"""A ball and methods with known radiance, for tests of pictures without a bake."""

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.methods.protocol import PointwiseMethod
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.film import developed
from rsibr.shading.lookups.registry import lookup_named
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes

DISTANCE = 5.0
"""Of the camera from the middle of the ball."""

TANGENT = 1 / np.sqrt(DISTANCE**2 - 1)
"""Radius of the unit ball's outline in the plane at unit depth."""


class Method(PointwiseMethod):
    """Radiance as a function of normal and view."""

    def __init__(self, radiance):
        super().__init__(None)
        self.radiance = radiance

    def eval(self, n, v):
        return mi.Color3f(self.radiance(n, v))


def constant():
    return Method(lambda n, v: mi.Color3f(0.25, 0.5, 1.0))


def slanted():
    """Radiance linear in the normal."""
    return Method(lambda n, v: mi.Color3f(1 + 0.5 * n.x, 1 + 0.5 * n.y, 1 + 0.5 * n.z))


def mirror(radiance):
    """A mirror under a light: direction → radiance."""
    return Method(lambda n, v: radiance(2 * dr.dot(n, v) * n - v))


def sun(peak=1e6, dark=1e-3, direction=(0.3, 0.4, 0.866), width=0.02):
    """A sun of Gaussian profile and about 1.6° in radius, next to darkness."""
    to_sun = np.array(direction) / np.linalg.norm(direction)
    axis = to_sun.tolist()
    return mirror(lambda d: mi.Color3f(dark + peak * dr.exp((dr.dot(d, mi.Vector3f(*axis)) - 1) / width**2)))


def ball_scene(radius=1.0, **others):
    ball = backend.load({"type": "sphere", "radius": radius})
    return ObjectScene("ball", {"ball": ball, **others})


def framing(resolution=32, **changed):
    """Camera on the axis +z whose picture's square touches the outline of the unit ball."""
    given = {"fov_deg": float(2 * np.degrees(np.arctan(TANGENT))), "width": resolution, "height": resolution}
    return Camera.look_at((0, 0, DISTANCE), (0, 0, 0), **(given | changed))


def pictured(method, camera, rays=1, lookup="pixel", scene=None, **options):
    """Picture of a scene whose shapes all have one method."""
    scene = scene or ball_scene()
    made = lookup_named(lookup).make(method, scene, **options)
    types = SurfaceTypes.assign(scene, ["*"])
    return developed(scene, camera, types, [made.toward(camera)], rays, has_footprints=made.needs_footprint)


def directions(camera, right, down):
    """Unit directions of the rays through places of the picture [pixels], by the camera's definition alone."""
    x = (2 * np.asarray(right) / camera.width - 1) * camera.half_width
    y = (1 - 2 * np.asarray(down) / camera.height) * camera.half_width * camera.height / camera.width
    local = np.stack(np.broadcast_arrays(x, y, -1.0), axis=-1)
    world = local @ camera.axes.T
    return world / np.linalg.norm(world, axis=-1, keepdims=True)


def on_ball(camera, d):
    """Distance along rays to the unit ball, nan if they miss, and the normals there."""
    along = -(d @ camera.position)
    inside = along**2 - (camera.position @ camera.position - 1)
    with np.errstate(invalid="ignore"):
        distance = along - np.sqrt(inside)
    return distance, camera.position + distance[..., None] * d


def centres(camera):
    """Places of the pixels' centres, right and down."""
    return np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)

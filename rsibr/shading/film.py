"""Kernel of a picture: rays spread over each pixel's square, averaged by a box filter."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.baking.lattice import generator
from rsibr.shading.camera import Camera, CameraRays
from rsibr.shading.lookups.registry import Shade
from rsibr.shading.object_scene import ObjectScene
from rsibr.shading.picture import NormalCounts, Picture
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import Surfaces, first_surfaces

PIXELS_PER_LAUNCH = 2**22
"""Most pixels of one kernel launch: 4K in two, 1080p in one."""


def place_steps(rays: int) -> tuple[mi.Float, mi.Float]:
    """Steps of the lattice of a pixel's rays, across and down [pixels]; opaque, so that all numbers share kernels."""
    return dr.opaque(mi.Float, 1 / rays), dr.opaque(mi.Float, generator(rays).texel[1] / rays)


def place_in_pixel(k: mi.UInt32, steps: tuple[mi.Float, mi.Float]) -> mi.Point2f:
    """Place of ray number `k` in the square of its pixel, in [0, 1)², from the top left."""
    along = mi.Float(k)
    place = mi.Point2f(dr.fma(along, steps[0], 0.5 * steps[0]), dr.fma(along, steps[1], 0.5 * steps[0]))
    return place - dr.floor(place)


@dataclass
class Sums:
    """Sums over the rays of a pixel, one pixel a lane.

    Attributes
    ----------
    radiance : mi.Color3f
    hits, replaced, flipped, bent, back : mi.UInt32
        See `NormalCounts`.
    depth : mi.Float
    normal : mi.Vector3f
    """

    radiance: mi.Color3f
    hits: mi.UInt32
    replaced: mi.UInt32
    flipped: mi.UInt32
    bent: mi.UInt32
    back: mi.UInt32
    depth: mi.Float
    normal: mi.Vector3f

    def adding(self, surfaces: Surfaces, radiance: mi.Color3f) -> Sums:
        """Sums with one more ray each."""

        def count(is_so: mi.Bool) -> mi.UInt32:
            return dr.select(is_so, mi.UInt32(1), 0)

        return Sums(
            radiance=self.radiance + radiance,
            hits=self.hits + count(surfaces.hit),
            replaced=self.replaced + count(surfaces.replaced),
            flipped=self.flipped + count(surfaces.flipped),
            bent=self.bent + count(surfaces.bent),
            back=self.back + count(surfaces.is_back),
            depth=self.depth + dr.select(surfaces.hit, surfaces.distance, 0),
            normal=self.normal + dr.select(surfaces.hit, surfaces.n, 0),
        )


def developed(scene: ObjectScene, camera: Camera, types: SurfaceTypes, shades: list[Shade], rays: int) -> Picture:
    """Trace and shade all pixels of a picture.

    Parameters
    ----------
    scene : ObjectScene
        Shapes.
    camera : Camera
        Camera.
    types : SurfaceTypes
        Type of each shape; surfaces of shapes without one count in no layer but hide what is behind them.
    shades : list of callable
        Radiance of the surfaces of each type.
    rays : int
        Rays a pixel.
    """
    on_device, pixels = camera.on_device(), camera.width * camera.height
    count, steps = dr.opaque(mi.UInt32, rays), place_steps(rays)
    parts = []
    for first in range(0, pixels, PIXELS_PER_LAUNCH):
        size = min(PIXELS_PER_LAUNCH, pixels - first)
        pixel = dr.arange(mi.UInt32, size) + dr.opaque(mi.UInt32, first)
        sums = _sums(scene.geometry, on_device, types, shades, pixel, count, steps)
        dr.eval(sums)
        parts.append(sums)
    return _picture(parts, camera, rays)


def _sums(
    geometry: mi.Scene,
    camera: CameraRays,
    types: SurfaceTypes,
    shades: list[Shade],
    pixel: mi.UInt32,
    count: mi.UInt32,
    steps: tuple[mi.Float, mi.Float],
) -> Sums:
    corner = camera.centre(pixel) - 0.5

    def one_ray(k: mi.UInt32, sums: Sums) -> tuple[mi.UInt32, Sums]:
        surfaces = first_surfaces(geometry, camera.ray(corner + place_in_pixel(k, steps)))
        kind = types.of(surfaces)
        radiance = mi.Color3f(0)
        for index, shade in enumerate(shades):
            wanted = kind == index
            radiance += dr.if_stmt((surfaces,), wanted, shade, lambda _: mi.Color3f(0), label=f"surface_type_{index}")
        surfaces.hit &= kind < len(shades)
        return k + 1, sums.adding(surfaces, radiance)

    sums: Sums = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(Sums, dr.width(pixel))),
        cond=lambda k, _: k < count,
        body=one_ray,
        labels=("ray", "sums"),
        label="rays_of_a_pixel",
    )[1]
    return sums


def _picture(parts: list[Sums], camera: Camera, rays: int) -> Picture:
    def column(name: str) -> np.ndarray:
        return np.concatenate([np.array(getattr(part, name)) for part in parts], axis=-1)

    shape = camera.height, camera.width
    hits = column("hits").astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(hits > 0, column("depth") / hits, np.inf).astype(np.float32)
    normal = column("normal")
    length = np.linalg.norm(normal, axis=0)
    counts = {name: int(column(name).sum(dtype=np.int64)) for name in ("hits", "replaced", "flipped", "bent", "back")}
    return Picture(
        radiance=(column("radiance").T / np.float32(rays)).reshape(*shape, 3).astype(np.float32),
        alpha=(hits / np.float32(rays)).reshape(shape),
        depth=depth.reshape(shape),
        normal=(normal / np.maximum(length, 1e-20)).T.reshape(*shape, 3).astype(np.float32),
        counts=NormalCounts(**counts),
    )

"""Kernel of a picture: rays spread over each pixel's square, averaged by a box filter."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.shading.cameras.camera import Camera, CameraRays
from rsibr.shading.corner_rays import corner_rays, footprint
from rsibr.shading.lookups.registry import Shade
from rsibr.shading.pictures.picture import NormalCounts, Picture
from rsibr.shading.pixel_lattice import place_in_pixel, place_steps
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import Surfaces, first_surfaces

PIXELS_PER_LAUNCH = 2**22
"""Most pixels of one kernel launch: 4K in two, 1080p in one."""


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


def developed(
    scene: ObjectScene,
    camera: Camera,
    types: SurfaceTypes,
    shades: list[Shade],
    rays: int,
    *,
    has_footprints: bool = False,
) -> Picture:
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
    has_footprints : bool
        Whether the corners of each ray's share of the pixel are traced: `Surfaces.footprint`.
    """
    on_device, pixels = camera.on_device(), camera.width * camera.height
    count, steps = dr.opaque(mi.UInt32, rays), place_steps(rays)
    side = dr.opaque(mi.Float, rays**-0.5) if has_footprints else None
    parts = []
    for first in range(0, pixels, PIXELS_PER_LAUNCH):
        size = min(PIXELS_PER_LAUNCH, pixels - first)
        pixel = dr.arange(mi.UInt32, size) + dr.opaque(mi.UInt32, first)
        sums = _sums(scene.geometry, on_device, types, shades, pixel, count, steps, side)
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
    side: mi.Float | None,
) -> Sums:
    corner = camera.centre(pixel) - 0.5

    def one_ray(k: mi.UInt32, sums: Sums) -> tuple[mi.UInt32, Sums]:
        place = corner + place_in_pixel(k, steps)
        surfaces = first_surfaces(geometry, camera.ray(place))
        if side is not None:
            surfaces.footprint = footprint(geometry, corner_rays(camera, place, side), surfaces)
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

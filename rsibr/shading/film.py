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
from rsibr.shading.surfaces import Surfaces, first_hits, surfaces_at

PIXELS_PER_LAUNCH = 2**22
"""Most pixels of one kernel launch: 4K in two, 1080p in one."""

_TILE = 4  # pixels a side: rays of neighbours are traced together, and share more of the way than those of a row
_COUNTS = ("hits", "replaced", "flipped", "bent", "back")


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
    on_device, layers = camera.on_device(), _Layers.unfilled(camera.width * camera.height)
    count, steps = dr.opaque(mi.UInt32, rays), place_steps(rays)
    side = dr.opaque(mi.Float, rays**-0.5) if has_footprints else None
    lanes = -(-camera.width // _TILE) * -(-camera.height // _TILE) * _TILE**2
    for first in range(0, lanes, PIXELS_PER_LAUNCH):
        lane = dr.arange(mi.UInt32, min(PIXELS_PER_LAUNCH, lanes - first)) + dr.opaque(mi.UInt32, first)
        pixel, is_inside = _tiled(lane, on_device)
        traced = dr.select(is_inside, count, 0)
        sums = _sums(scene.geometry, on_device, types, shades, pixel, traced, steps, side)
        layers.fill(pixel, sums, count, is_inside)
        dr.eval(layers)
    return layers.picture(camera)


def _tiled(lane: mi.UInt32, camera: CameraRays) -> tuple[mi.UInt32, mi.Bool]:
    """Pixel of each lane, tile by tile, and whether it lies in the picture: tiles may reach beyond it."""
    tile, within = lane // _TILE**2, lane % _TILE**2
    across = (camera.width + (_TILE - 1)) // _TILE
    column, row = tile % across * _TILE + within % _TILE, tile // across * _TILE + within // _TILE
    return row * camera.width + column, (column < camera.width) & (row < camera.height)


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
        ray = camera.ray(place)
        found = first_hits(geometry, ray)
        arguments = found, ray, place, sums
        return k + 1, dr.if_stmt(arguments, found.is_valid(), shaded, lambda *unchanged: unchanged[-1], label="hit")

    def shaded(found: mi.PreliminaryIntersection3f, ray: mi.Ray3f, place: mi.Point2f, sums: Sums) -> Sums:
        surfaces = surfaces_at(found, ray)
        if side is not None:
            surfaces.footprint = footprint(geometry, corner_rays(camera, place, side), surfaces)
        kind = types.of(surfaces)
        radiance = mi.Color3f(0)
        for index, shade in enumerate(shades):
            wanted = kind == index
            radiance += dr.if_stmt((surfaces,), wanted, shade, lambda _: mi.Color3f(0), label=f"surface_type_{index}")
        surfaces.hit &= kind < len(shades)
        return sums.adding(surfaces, radiance)

    sums: Sums = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(Sums, dr.width(pixel))),
        cond=lambda k, _: k < count,
        body=one_ray,
        labels=("ray", "sums"),
        label="rays_of_a_pixel",
    )[1]
    return sums


@dataclass
class _Layers:
    """Layers of a picture on the device, row by row, flat.

    Attributes
    ----------
    radiance, alpha, depth, normal : mi.Float
        See `Picture`.
    counts : mi.UInt64
        See `NormalCounts`, in the order of `_COUNTS`.
    """

    radiance: mi.Float
    alpha: mi.Float
    depth: mi.Float
    normal: mi.Float
    counts: mi.UInt64

    @classmethod
    def unfilled(cls, pixels: int) -> _Layers:
        """Layers of so many pixels, whose values are undefined; all counts are zero."""
        radiance, alpha, depth, normal = (dr.empty(mi.Float, channels * pixels) for channels in (3, 1, 1, 3))
        return cls(radiance, alpha, depth, normal, dr.zeros(mi.UInt64, len(_COUNTS)))

    def fill(self, pixel: mi.UInt32, sums: Sums, rays: mi.UInt32, active: mi.Bool) -> None:
        """Write the means over the rays of pixels."""
        hits, traced = mi.Float(sums.hits), mi.Float(rays)
        dr.scatter(self.radiance, sums.radiance / traced, pixel, active)
        dr.scatter(self.alpha, hits / traced, pixel, active)
        dr.scatter(self.depth, dr.select(sums.hits > 0, sums.depth / hits, dr.inf), pixel, active)
        dr.scatter(self.normal, sums.normal / dr.maximum(dr.norm(sums.normal), 1e-20), pixel, active)
        for place, name in enumerate(_COUNTS):
            count = getattr(sums, name)
            dr.scatter_reduce(dr.ReduceOp.Add, self.counts, mi.UInt64(count), mi.UInt32(place), active & (count > 0))

    def picture(self, camera: Camera) -> Picture:
        """Copy to the host."""
        shape, counts = (camera.height, camera.width), (int(count) for count in np.array(self.counts))
        return Picture(
            radiance=np.array(self.radiance).reshape(*shape, 3),
            alpha=np.array(self.alpha).reshape(shape),
            depth=np.array(self.depth).reshape(shape),
            normal=np.array(self.normal).reshape(*shape, 3),
            counts=NormalCounts(**dict(zip(_COUNTS, counts, strict=True))),
        )

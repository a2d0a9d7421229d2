"""Primary rays of a picture and of its truth: the same camera, the same places in each pixel's square.

With the same places, picture and truth see the same surfaces, and their difference is an error of shading alone. A
picture against one of Mitsuba's camera would differ at silhouettes by the antialiasing of a few rays, which would hide
all else there; `antialiasing` is measured apart, against rays all over the square.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.shading.cameras.camera import Camera, CameraRays
from rsibr.shading.film import developed
from rsibr.shading.pictures.picture import Picture
from rsibr.shading.pixel_lattice import place_in_pixel, place_steps
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import Surfaces, first_surfaces

LANES_PER_LAUNCH = 2**22
"""Most rays of one kernel launch; limits memory."""


@dataclass(frozen=True, eq=False)
class PrimaryRays:
    """Primary rays of a picture.

    Attributes
    ----------
    scene : ObjectScene
        Shapes.
    types : SurfaceTypes
        Type of each shape; only surfaces with a bake count.
    camera : Camera
        Camera.
    rays : int
        Places in the square of a pixel.
    """

    scene: ObjectScene
    types: SurfaceTypes
    camera: Camera
    rays: int

    @cached_property
    def layers(self) -> Picture:
        """Picture without radiance: coverage, depth, normals, counts."""
        black = [lambda _: mi.Color3f(0)] * len(self.types.names)
        return developed(self.scene, self.camera, self.types, black, self.rays)

    @cached_property
    def pixels(self) -> NDArray[np.uint32]:
        """Numbers of the pixels with `coverage`, row by row from the top."""
        return np.flatnonzero(self.coverage).astype(np.uint32)

    @property
    def bent(self) -> NDArray[np.float32]:
        """Share of a pixel's rays whose shading normal was bent to the horizon, shape (H, W): Mitsuba does not."""
        bent, _ = self._made_safe
        return bent

    @cached_property
    def coverage(self) -> NDArray[np.float32]:
        """Coverage of the pixels to be judged, shape (H, W): 0 where a shading normal was no direction.

        Mitsuba's radiance is NaN at such a normal.
        """
        return np.where(self._made_safe[1] > 0, np.float32(0), self.layers.alpha)

    @cached_property
    def _made_safe(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Share of each pixel's rays with bent and with replaced normals, shape (H, W) each."""
        alpha = self.layers.alpha
        covered = np.flatnonzero(alpha).astype(np.uint32)
        share = np.zeros((2, alpha.size), dtype=np.float32)
        step = max(1, LANES_PER_LAUNCH // self.rays)
        for first in range(0, len(covered), step):
            part = covered[first : first + step]
            share[:, part] = self._shares(to_device(mi.UInt32, part))
        bent, replaced = share.reshape(2, *alpha.shape)
        return bent, replaced

    def trace(self, pixel: mi.UInt32, place: mi.Point2f) -> tuple[mi.Ray3f, Surfaces, mi.UInt32]:
        """Trace rays to the first surfaces.

        Parameters
        ----------
        pixel : mi.UInt32
            Pixel of each ray.
        place : mi.Point2f
            Place in its square, in [0, 1)².

        Returns
        -------
        tuple
            Rays, surfaces, and the type of each surface; `rsibr.shading.surface_types.UNBAKED` for what does not count.
        """
        on_device = self._on_device
        ray = on_device.ray(on_device.centre(pixel) - 0.5 + place)
        surfaces = first_surfaces(self.scene.geometry, ray)
        return ray, surfaces, self.types.of(surfaces)

    def place(self, number: mi.UInt32) -> mi.Point2f:
        """Place in the square of its pixel of each ray, by its number below `rays`."""
        return place_in_pixel(number, self._steps)

    @cached_property
    def _on_device(self) -> CameraRays:
        return self.camera.on_device()

    @cached_property
    def _steps(self) -> tuple[mi.Float, mi.Float]:
        return place_steps(self.rays)

    def _shares(self, pixels: mi.UInt32) -> NDArray[np.float32]:
        lane = dr.arange(mi.UInt32, dr.width(pixels) * self.rays)
        pixel = dr.gather(mi.UInt32, pixels, lane // self.rays)
        _, surfaces, kind = self.trace(pixel, self.place(lane % self.rays))
        counts = kind < len(self.types.names)
        marks = [dr.select(counts & mark, mi.Float(1), 0) for mark in (surfaces.bent, surfaces.replaced)]
        sums = np.array([np.array(dr.block_sum(mark, self.rays)) for mark in marks], dtype=np.float32)
        return sums / np.float32(self.rays)

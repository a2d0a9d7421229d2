"""Surfaces without a bake, path-traced under the environment of the bakes: the rest of a picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera, CameraRays
from rsibr.shading.film import PIXELS_PER_LAUNCH
from rsibr.shading.pixel_lattice import place_in_pixel, place_steps
from rsibr.shading.scenes.lit_scene import lit_scene
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import UNBAKED, SurfaceTypes
from rsibr.shading.surfaces import first_surfaces
from rsibr.store.bake import Bake

SAMPLES = 256
"""Paths a pixel by default."""

_PATHS_PER_LAUNCH = 2**20
_PATH = {"integrator": {"type": "path"}}
_NAMED = 5  # shapes that a message names


def unbaked_refusal(scene: ObjectScene, types: SurfaceTypes) -> InputError | None:
    """Error that names the shapes without a bake; None if there are none."""
    names = types.unbaked(scene)
    if not names:
        return None
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    listed = ", ".join(f"'{name}'" for name in names[:_NAMED]) + more
    fix = f"give --bake {names[0]}=BAKE, or leave out --strict to path-trace them"
    return InputError(f"no bake for {listed}", where=scene.name, fix=fix)


@backend.in_session
def path_traced_rest(
    scene: ObjectScene,
    types: SurfaceTypes,
    bakes: Mapping[str, Bake],
    camera: Camera,
    rays: int,
    seed: int,
    samples: int = SAMPLES,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Path-trace the surfaces without a bake that the camera sees.

    They are lit by the environment of the bakes and by each other. Surfaces with a bake, seen in a mirror or through
    glass, have the material that was baked.

    Parameters
    ----------
    scene : ObjectScene
        Shapes, without emitters. Those with a bake are given its material.
    types : SurfaceTypes
        Type of each shape.
    bakes : mapping of str to Bake
        Bake of each type, in the order of `types.names`.
    camera : Camera
        Camera.
    rays : int
        Primary rays a pixel: those of the film, so that the two parts of a picture share each pixel without a seam.
    seed : int
        Determines all random numbers.
    samples : int
        Least number of paths a pixel, shared by its rays.

    Returns
    -------
    radiance : ndarray, shape (H, W, 3), float32
        Mean over the rays of a pixel [W sr⁻¹ m⁻²]; rays that meet a surface with a bake, or none, count as zero.
    alpha : ndarray, shape (H, W), float32
        Share of the rays that meet a surface without a bake. What is seen through it is part of its radiance.

    Raises
    ------
    InputError, BakeError
        As `rsibr.shading.scenes.lit_scene.lit_scene`.

    Examples
    --------
    >>> radiance, alpha = path_traced_rest(scene, types, bakes, camera, rays=16, seed=0)       # doctest: +SKIP
    >>> whole = picture.radiance + radiance                                                   # doctest: +SKIP
    """
    pixels, total = camera.width * camera.height, np.zeros((4, camera.width * camera.height))
    if types.unbaked(scene):
        tracer = _Tracer.of(lit_scene(scene, types, bakes, _PATH), camera, rays, samples, seed)
        for ray in _unbaked_rays(scene, types, tracer.primary, pixels * rays):
            pixel = np.array(tracer.primary.pixel(ray))
            values = [*tracer.mean_radiance(ray), np.ones(len(pixel))]
            total += [np.bincount(pixel, value, pixels) for value in values]  # in order, unlike atomic additions
    image = (total.T / rays).astype(np.float32).reshape(camera.height, camera.width, 4)
    return image[..., :3], image[..., 3]


@dataclass(eq=False)
class _Primary:
    """Primary rays of a picture by number: those of a pixel follow each other."""

    camera: CameraRays
    count: mi.UInt32
    steps: tuple[mi.Float, mi.Float]

    def pixel(self, number: mi.UInt32) -> mi.UInt32:
        return number // self.count

    def ray(self, number: mi.UInt32) -> mi.Ray3f:
        place = place_in_pixel(number % self.count, self.steps)
        return self.camera.ray(self.camera.centre(self.pixel(number)) - 0.5 + place)


def _unbaked_rays(scene: ObjectScene, types: SurfaceTypes, primary: _Primary, count: int) -> Iterator[mi.UInt32]:
    """Numbers of the primary rays that meet a surface without a bake."""
    for first in range(0, count, PIXELS_PER_LAUNCH):
        number = dr.arange(mi.UInt32, min(PIXELS_PER_LAUNCH, count - first)) + dr.opaque(mi.UInt32, first)
        surfaces = first_surfaces(scene.geometry, primary.ray(number))
        found = dr.compress(surfaces.hit & (types.of(surfaces) == UNBAKED))
        if dr.width(found):
            yield found + dr.opaque(mi.UInt32, first)


@dataclass(eq=False)
class _Tracer:
    """Path tracer of primary rays, several paths each."""

    scene: mi.Scene
    primary: _Primary
    sampler: mi.Sampler
    seeds: np.random.SeedSequence

    @classmethod
    def of(cls, scene: mi.Scene, camera: Camera, rays: int, samples: int, seed: int) -> _Tracer:
        primary = _Primary(camera.on_device(), dr.opaque(mi.UInt32, rays), place_steps(rays))
        sampler = backend.load({"type": "multijitter", "sample_count": max(-(-samples // rays), 1)})
        return cls(scene, primary, sampler, np.random.SeedSequence(seed))

    def mean_radiance(self, ray: mi.UInt32) -> NDArray[np.float32]:
        """Mean radiance over the paths of each ray, shape (3, rays)."""
        each = max(1, _PATHS_PER_LAUNCH // self.sampler.sample_count())
        starts = range(0, len(ray), each)
        return np.concatenate([self._launch(ray, start, min(each, len(ray) - start)) for start in starts], axis=1)

    def _launch(self, ray: mi.UInt32, start: int, count: int) -> NDArray[np.float32]:
        paths = self.sampler.sample_count()
        self.sampler.set_samples_per_wavefront(paths)
        self.sampler.seed(int(self.seeds.spawn(1)[0].generate_state(1)[0]), count * paths)
        index = dr.arange(mi.UInt32, count * paths) // dr.opaque(mi.UInt32, paths) + dr.opaque(mi.UInt32, start)
        along = mi.RayDifferential3f(self.primary.ray(dr.gather(mi.UInt32, ray, index)))
        radiance, _, _ = self.scene.integrator().sample(self.scene, self.sampler, along)
        return np.array([dr.block_sum(channel, paths) for channel in radiance], dtype=np.float32) / np.float32(paths)

"""Truth for the picture of an object, as independent buffers: open, shadowed, and path-traced."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.baking.scene import Scene
from rsibr.geometry.to_device import to_device
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.renderer import RAYS
from rsibr.shading.scenes.lit_scene import lit_scene, prepared_scenes
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.store.bake import Bake
from rsibr.validation.objects.estimators import Estimator, one_map, open_shading, open_spheres, traced
from rsibr.validation.objects.primary_rays import LANES_PER_LAUNCH, PrimaryRays
from rsibr.validation.reference import MINIMUM_BUFFERS, SAMPLER, Reference, stratified

_BRANCH = 0x6F626A65
"""Branch of the seed tree (the letters "obje"); no random number is shared with a bake of the same root seed."""

_WARM_UP = 64  # pixels of the launch that compiles


@dataclass(frozen=True, eq=False)
class ObjectTruths:
    """Truths of one picture, all over the same primary rays; each buffer takes its own random numbers.

    Attributes
    ----------
    primary : PrimaryRays
        Rays of the picture.
    bakes : dict of str to Bake
        Bake of each type.
    prepared : list of Scene
        Scene of each bake.
    samples : int
        Minimum samples a pixel, total of all buffers. A buffer takes at least one at each place.
    buffers : int
        Independent buffers.
    seed : int
        Root of the seed tree.
    max_lanes : int
        Most samples of one kernel launch.
    """

    primary: PrimaryRays
    bakes: dict[str, Bake]
    prepared: Sequence[Scene]
    samples: int
    buffers: int = MINIMUM_BUFFERS
    seed: int = 0
    max_lanes: int = LANES_PER_LAUNCH

    def open(self) -> Reference:
        """Truth (a): open shading at the safe normals, nothing hidden."""
        return self._reference(open_shading(self._spheres), 0)

    def open_all_over(self) -> Reference:
        """Truth (a) from rays all over each pixel's square; its coverage is that of the picture's places."""
        return self._reference(open_shading(self._spheres), 1, all_over=True)

    def one_map(self) -> Reference:
        """What one exact map of the camera's central direction gives for open shading."""
        warps = [scene.material.warp for scene in self.prepared]
        return self._reference(one_map(self._spheres, self.primary.camera, warps), 2)

    def shadowed(self) -> Reference:
        """Truth (b): shadows, no bounces; Mitsuba's `direct`."""
        return self._reference(traced(self._lit, "direct", len(self.prepared)), 3)

    def full(self) -> Reference:
        """Truth (c): shadows and bounces; Mitsuba's `path`."""
        return self._reference(traced(self._lit, "path", len(self.prepared)), 4)

    @property
    def samples_of_buffer(self) -> int:
        """Samples a pixel of each buffer."""
        return stratified(max(-(-self.samples // self.buffers), self.primary.rays))

    @cached_property
    def _spheres(self) -> list[mi.Scene]:
        return open_spheres(self.prepared)

    @cached_property
    def _lit(self) -> mi.Scene:
        return lit_scene(self.primary.scene, self.primary.types, self.bakes, prepared=self.prepared)

    def _reference(self, estimator: Estimator, branch: int, all_over: bool = False) -> Reference:
        pixels, alpha = self.primary.pixels, self.primary.coverage
        seeds = np.random.SeedSequence(self.seed, spawn_key=(_BRANCH, branch))
        # ---- Compile ----
        start = time.perf_counter()
        self._launch(estimator, pixels[:_WARM_UP], 0, all_over)
        compile_seconds, start = time.perf_counter() - start, time.perf_counter()
        # ---- Render; coverage is divided out ----
        made = np.zeros((self.buffers, alpha.size, 3), dtype=np.float32)
        for buffer, own in zip(made, seeds.spawn(self.buffers), strict=True):
            for first, seed in self._launches(len(pixels), own):
                part = pixels[first : first + self._step]
                buffer[part] = self._launch(estimator, part, seed, all_over)
        made[:, pixels] /= alpha.ravel()[pixels, None]
        return Reference(
            buffers=made.reshape(self.buffers, *alpha.shape, 3),
            coverage=alpha,
            samples=self.samples_of_buffer * self.buffers,
            seconds=time.perf_counter() - start,
            compile_seconds=compile_seconds,
            sampler=SAMPLER,
        )

    @property
    def _step(self) -> int:
        """Pixels of a launch."""
        return max(1, self.max_lanes // self.samples_of_buffer)

    def _launches(self, pixels: int, seeds: np.random.SeedSequence) -> Iterator[tuple[int, int]]:
        firsts = range(0, pixels, self._step)
        for first, seed in zip(firsts, seeds.generate_state(len(firsts)), strict=True):
            yield first, int(seed)

    def _launch(
        self, estimator: Estimator, pixels: NDArray[np.uint32], seed: int, all_over: bool
    ) -> NDArray[np.float32]:
        """Premultiplied radiance of pixels, shape (P, 3)."""
        # ---- A sample a lane: pixel, and number within it ----
        each, rays = self.samples_of_buffer, self.primary.rays
        lanes = len(pixels) * each
        sampler = _sampler(each, lanes, seed)
        lane = dr.arange(mi.UInt32, lanes)
        block = lane // each
        number = lane - block * each
        pixel = dr.gather(mi.UInt32, to_device(mi.UInt32, pixels), block)
        # ---- Place in the pixel's square, and weight: all places count alike ----
        k = number % rays
        place = sampler.next_2d() if all_over else self.primary.place(k)
        at_place = each // rays + dr.select(k < each % rays, mi.UInt32(1), 0)
        weight = mi.Float(1 / each) if all_over else dr.rcp(mi.Float(at_place) * rays)
        # ---- Radiance ----
        ray, surfaces, kind = self.primary.trace(pixel, place)
        radiance = weight * estimator(ray, surfaces, kind, sampler)
        dr.eval(radiance)
        means = [np.array(dr.block_sum(channel, each)) for channel in radiance]
        backend.synchronize()
        return np.stack(means, axis=-1).astype(np.float32)


@backend.in_session
def object_truths(
    scene: ObjectScene,
    bakes: Mapping[str, Bake],
    camera: Camera,
    *,
    rays: int = RAYS,
    samples: int = 1024,
    buffers: int = MINIMUM_BUFFERS,
) -> ObjectTruths:
    """Truths of a picture of an object, each rendered when it is asked for; `rsibr.metrics.compare` takes them.

    Parameters
    ----------
    scene : ObjectScene
        Shapes, from `rsibr.open_scene`.
    bakes : mapping of str to Bake
        Bake of each shape by its id; `"*"` stands for all other shapes.
    camera : Camera
        Camera, such as `rsibr.fitted_camera`.
    rays : int
        Rays a pixel; pictures to be compared are made with as many.
    samples : int
        Minimum samples a pixel of each truth, total of all buffers.
    buffers : int
        Independent buffers of a truth, at least 8.

    Returns
    -------
    ObjectTruths
        Its methods `open`, `one_map`, `shadowed` and `full` render.

    Raises
    ------
    InputError
        If a shape id is unknown.
    BakeError
        If an input of a bake has changed.
    """
    primary = PrimaryRays(scene, SurfaceTypes.assign(scene, list(bakes)), camera, rays)
    seed = int(next(iter(bakes.values())).config["sampling"]["seed"])
    return ObjectTruths(primary, dict(bakes), prepared_scenes(bakes), samples, buffers, seed)


def _sampler(samples: int, lanes: int, seed: int) -> mi.Sampler:
    """Sampler whose blocks of `samples` lanes are stratified."""
    sampler = backend.load({"type": SAMPLER})
    sampler.set_sample_count(samples)
    sampler.set_samples_per_wavefront(samples)
    sampler.seed(dr.opaque(mi.UInt32, seed), lanes)
    sampler.schedule_state()
    dr.eval()
    return sampler

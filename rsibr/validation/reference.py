"""Path-traced reference: the material on a sphere in a complete Mitsuba scene.

It shares no code with the bake: Mitsuba's `path` integrator instead of the lobe-resolved direct one, a `sphere` shape
instead of analytic normals, and Mitsuba's camera, film and sampler.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.backend import Rendering
from rsibr.errors import InputError

MINIMUM_BUFFERS = 8
"""Minimum number of independent renderings of a reference; their variance gives its noise."""

LANES_PER_LAUNCH = 2**24
"""Maximum samples of one kernel launch: enough to occupy a device, far below the limit of 2^32."""

SAMPLER = "multijitter"

_REFERENCE_BRANCH = 0x7265_6665
"""Branch of the seed tree (the letters "refe"); no random number is shared with a bake of the same root seed."""

_CAMERA_DISTANCE = 2.0


class Emitting(Protocol):
    """Protocol of an environment as a reference uses it."""

    def emitter(self) -> dict[str, Any]:
        """Mitsuba dictionary of the emitter."""


class Reflecting(Protocol):
    """Protocol of a material as a reference uses it."""

    def bsdf(self) -> Any:
        """Mitsuba BSDF in the current variant."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Path-traced sphere map of one view, as independent buffers.

    Attributes
    ----------
    buffers : ndarray, shape (K, H, W, 3), float32
        Radiance [W sr⁻¹ m⁻²], coverage divided out; 0 without coverage. Their mean is the reference, their variance
        gives its noise.
    coverage : ndarray, shape (H, W), float32
        Share of each texel covered by the sphere, from the alpha channel of the rendering.
    samples : int
        Samples a texel, total of all buffers.
    seconds : float
        Rendering time of all buffers until the device has finished, without compilation [s].
    compile_seconds : float
        Time of the warm-up pass that compiled the kernels [s]; 0 if they were compiled before.
    sampler : str
        Mitsuba's name of the sampler.
    """

    buffers: NDArray[np.float32]
    coverage: NDArray[np.float32]
    samples: int
    seconds: float
    compile_seconds: float = 0.0
    sampler: str = SAMPLER

    @property
    def mean(self) -> NDArray[np.float32]:
        """Radiance, shape (H, W, 3): the mean of the buffers."""
        return np.asarray(self.buffers.mean(axis=0, dtype=np.float64), dtype=np.float32)

    @property
    def variance_of_mean(self) -> NDArray[np.float32]:
        """Variance of `mean`, shape (H, W, 3): the buffers' sample variance divided by their number."""
        variance = self.buffers.var(axis=0, ddof=1, dtype=np.float64) / len(self.buffers)
        return np.asarray(variance, dtype=np.float32)


class ReferenceRenderer:
    """Path tracer of one material under one environment for any view; the scene is built and compiled once.

    Parameters
    ----------
    environment : Emitting
        Object with a method `emitter`, such as an `Environment`.
    material : Reflecting
        Object with a method `bsdf`, such as a `Material`.
    resolution : int
        Texels a side.
    rendering : {"rgb", "spectral", "spectral_polarized"}
        Quantity carried along a path. Mitsuba's film converts spectra to linear RGB.
    max_lanes : int
        Maximum samples of one kernel launch.
    """

    def __init__(
        self,
        environment: Emitting,
        material: Reflecting,
        resolution: int,
        rendering: Rendering = "rgb",
        max_lanes: int = LANES_PER_LAUNCH,
    ) -> None:
        self.max_lanes = max_lanes
        self.resolution = resolution
        self.rendering = rendering
        with backend.rendering(rendering):
            self._scene = backend.load(_scene(environment, material, resolution))
            self._parameters = mi.traverse(self._scene)
        self._compiled: set[int] = set()

    def render(self, frame: ArrayLike, samples: int, seed: int = 0, buffers: int = MINIMUM_BUFFERS) -> Reference:
        """Path-trace the sphere map of one view.

        Parameters
        ----------
        frame : array_like, shape (3, 3)
            Frame of the map: columns x (right), y (up), z = v in world coordinates.
        samples : int
            Minimum samples a texel, total of all buffers. Each pass is rounded up to a grid that the sampler can
            stratify; `Reference.samples` is the actual number.
        seed : int
            Root of the seed tree, ≥ 0. The seeds depend on the view too: two views share no random numbers.
        buffers : int
            Independent buffers, ≥ 8.

        Returns
        -------
        Reference

        Raises
        ------
        InputError
            If there are fewer than 8 buffers, or fewer samples than buffers.
        """
        passes, spp = _passes(samples, buffers, self.resolution, self.max_lanes)
        frame = np.asarray(frame, dtype=np.float64)
        seeds = _seeds(seed, frame, buffers * passes).reshape(buffers, passes)
        with backend.rendering(self.rendering):
            return self._rendered(frame, seeds, spp)

    def _rendered(self, frame: NDArray[np.float64], seeds: NDArray[np.uint32], spp: int) -> Reference:
        self._look_along(frame)
        compile_seconds = self._warm_up(spp)

        start = time.perf_counter()
        films = np.stack([self._buffer(row, spp) for row in seeds])
        backend.synchronize()
        seconds = time.perf_counter() - start

        radiance, coverage = _without_coverage(films)
        return Reference(radiance, coverage, seeds.size * spp, seconds, compile_seconds)

    def _look_along(self, frame: NDArray[np.float64]) -> None:
        """Set the camera's transform, which is an opaque input of the kernel, so that nothing is recompiled."""
        key = "sensor.to_world"
        self._parameters[key] = mi.AffineTransform4f(_camera_to_world(frame))
        dr.make_opaque(self._parameters[key])
        self._parameters.update()

    def _warm_up(self, spp: int) -> float:
        """Compile the kernel for passes of `spp` samples unless it is compiled already; return the time [s]."""
        if spp in self._compiled:
            return 0.0
        start = time.perf_counter()
        self._film(seed=0, spp=spp)
        backend.synchronize()
        self._compiled.add(spp)
        return time.perf_counter() - start

    def _buffer(self, seeds: NDArray[np.uint32], spp: int) -> NDArray[np.float32]:
        total = np.zeros((self.resolution, self.resolution, 4))
        for seed in seeds:  # one launch at a time, so that memory does not grow with their number
            total += self._film(int(seed), spp)
        return (total / len(seeds)).astype(np.float32)

    def _film(self, seed: int, spp: int) -> NDArray[np.float32]:
        """Premultiplied colour and alpha of one launch; shape (N, N, 4)."""
        return np.asarray(mi.render(self._scene, seed=seed, spp=spp).numpy())


def render_reference(
    environment: Emitting,
    material: Reflecting,
    frame: ArrayLike,
    resolution: int,
    samples: int,
    *,
    seed: int = 0,
    buffers: int = MINIMUM_BUFFERS,
    rendering: Rendering = "rgb",
) -> Reference:
    """Path-trace the sphere map of a single view; for more than one, keep a `ReferenceRenderer`.

    Parameters
    ----------
    environment, material, resolution, rendering
        As in `ReferenceRenderer`.
    frame, samples, seed, buffers
        As in `ReferenceRenderer.render`.

    Returns
    -------
    Reference
    """
    return ReferenceRenderer(environment, material, resolution, rendering).render(frame, samples, seed, buffers)


def _scene(environment: Emitting, material: Reflecting, resolution: int) -> dict[str, Any]:
    return {
        "type": "scene",
        "integrator": {"type": "path", "hide_emitters": True},  # texels beside the sphere are empty
        "sensor": {
            "type": "orthographic",  # field of view [−1, 1]²: the unit sphere fills the image
            "to_world": mi.ScalarAffineTransform4f(_camera_to_world(np.eye(3))),
            "near_clip": _CAMERA_DISTANCE / 4,
            "far_clip": _CAMERA_DISTANCE * 2,
            "film": {
                "type": "hdrfilm",
                "width": resolution,
                "height": resolution,
                "pixel_format": "rgba",
                "component_format": "float32",
                "rfilter": {"type": "box"},  # texels stay independent, and a texel is the mean over its area
            },
            "sampler": {"type": SAMPLER},
        },
        "sphere": {"type": "sphere", "material": material.bsdf()},
        "environment": environment.emitter(),
    }


def _camera_to_world(frame: NDArray[np.float64]) -> NDArray[np.float32]:
    """Camera transform of a frame; Mitsuba's cameras look along +z with +x to the *left*."""
    x, y, v = frame.T
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([-x, y, -v, _CAMERA_DISTANCE * v])
    return matrix.astype(np.float32)


def _passes(samples: int, buffers: int, resolution: int, max_lanes: int) -> tuple[int, int]:
    """Number of passes of a buffer, and samples of a pass as a product that `multijitter` does not round."""
    if buffers < MINIMUM_BUFFERS:
        raise InputError(f"{buffers} buffers are too few to tell noise from error", fix="ask for 8 or more")
    if samples < buffers:
        raise InputError(
            f"{samples} samples cannot be shared out over {buffers} independent buffers",
            where="samples",
            fix=f"ask for {buffers} or more",
        )
    wanted = math.ceil(samples / buffers)
    passes = math.ceil(wanted * resolution**2 / max_lanes)
    return passes, stratified(math.ceil(wanted / passes))


def stratified(samples: int) -> int:
    """Smallest number ≥ `samples` that is a product of two nearly equal factors, the strata of `multijitter`."""
    columns = math.isqrt(samples)
    return columns * -(-samples // columns)


def _seeds(seed: int, frame: NDArray[np.float64], count: int) -> NDArray[np.uint32]:
    """Seeds of the passes, from the root seed and the bits of the view."""
    view = (frame[:, 2] + 0.0).view(np.uint32)  # + 0.0: −0 and 0 are one direction
    branch = (_REFERENCE_BRANCH, *(int(word) for word in view))
    return np.random.SeedSequence(seed, spawn_key=branch).generate_state(count).astype(np.uint32)


def _without_coverage(films: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Divide coverage out of premultiplied colour, shape (K, H, W, 4), except in texels without coverage.

    The radiance of a texel is the ratio of two sums over all buffers, ΣL/Σα. Each buffer holds its linearisation,
    R̄ + (L_k − R̄ α_k)/ᾱ. The mean over the buffers is then that ratio, their variance is its variance by the delta
    method, and a buffer that missed a rim texel causes no division by zero.
    """
    colour, alpha = films[..., :3], films[..., 3:]
    mean_alpha = alpha.mean(axis=0, dtype=np.float64)
    safe = np.where(mean_alpha > 0, mean_alpha, 1.0)
    ratio = colour.mean(axis=0, dtype=np.float64) / safe
    buffers = [
        np.where(mean_alpha > 0, ratio + (c - ratio * a) / safe, 0.0) for c, a in zip(colour, alpha, strict=True)
    ]
    return np.stack(buffers, dtype=np.float32, casting="same_kind"), mean_alpha[..., 0].astype(np.float32)

"""Measured cost of a map on this machine: as planned, and with one decision of the plan reversed."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from rsibr import backend
from rsibr.backend import Rendering
from rsibr.baking.blocks import Blocks, block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.scene import Scene
from rsibr.geometry.frame import view_frame
from rsibr.planning.costs import Costs
from rsibr.planning.plan import Plan
from rsibr.store.health import map_health
from rsibr.store.map_file import MapFile, encode_map

MAX_LANES = 2**19
"""Samples of a trial: enough to occupy all cores, about 0.1 s of work."""

RUNS = 5
"""Timed runs after the one that compiles. The shortest is used, because other load can only lengthen a run."""

TRIAL_SIDE = 256
"""Texels a side, at most, of the map whose size and time of storing are measured, and scaled."""

SYNC_SECONDS = 0.01
"""Upper bound on the time to sync a map and the manifest to disk [s]."""

SOURCE = "calibrated: the shortest of 5 launches of each kernel on this machine, scaled to the samples of the bake"


def calibrate(scene: Scene, samples: int) -> Costs:
    """Time small launches of the kernels of a bake.

    Parameters
    ----------
    scene : Scene
        Scene to bake.
    samples : int
        Samples a texel of the bake.

    Returns
    -------
    Costs
        Seconds and bytes of a map as planned, and with each decision of the plan reversed.
    """
    options, other = scene.options, _other_rendering(scene.plan)
    planned = scene.integrator
    kernels = {
        "seconds": planned,
        "other_colour": scene.integrator_with(replace(options, grey=not options.grey)),
        "other_sampling": scene.integrator_with(replace(options, light_samples=not options.light_samples)),
    }
    if len(planned.lobe_names) > 1:
        kernels["one_lobe"] = scene.integrator_with(replace(options, left_out=()), keeps_apart=False)
    if other is not None:
        kernels["other_rendering"] = scene.integrator_with(options, rendering=other)
    seconds, compilation = _map_seconds(kernels, samples)
    return Costs(
        views=len(scene.all_around),
        lobes=len(planned.lobe_names),
        bytes=map_bytes(planned),
        other_colour_bytes=map_bytes(kernels["other_colour"]),
        overhead_seconds=compilation + len(scene.viewpoints) * map_overhead(planned),
        light_bytes=0,
        source=SOURCE,
        **seconds,
    )


def _other_rendering(plan: Plan) -> Rendering | None:
    """Rendering to compare with the planned one: RGB, or spectra if the plan is RGB although the scene has spectra."""
    if plan.rendering != "rgb":
        return "rgb"
    return "spectral" if plan["spectral"].evidence > 0 else None


def _map_seconds(kernels: dict[str, SphereIntegrator], samples: int) -> tuple[dict[str, float], float]:
    """Seconds of a map for each kernel, scaled from launches of at most `MAX_LANES` samples; first compile time."""
    # ---- Launch size ----
    blocks = block_sizes(samples)
    count = int(blocks.counts)
    texels = int(np.count_nonzero(next(iter(kernels.values())).coverage))
    each = max(1, min(blocks.size, MAX_LANES // texels))
    frame = view_frame(np.array([1.0, 2.0, 3.0]))
    shortest, compiled = dict.fromkeys(kernels, math.inf), list[float]()
    # ---- Run -1 compiles; kernels take turns, so that temporary load affects all of them alike ----
    for run in range(-1, RUNS):
        for name, kernel in kernels.items():
            with backend.rendering(kernel.rendering):
                start = time.perf_counter()
                kernel.block(frame, each, np.random.SeedSequence(run + 1))
                backend.synchronize()
                seconds = time.perf_counter() - start
            if run >= 0:
                shortest[name] = min(shortest[name], seconds)
            else:
                compiled.append(seconds)
    # ---- Scale to the samples of the bake ----
    scale = blocks.size * count / each
    compilation = max(0.0, compiled[0] - next(iter(shortest.values())))
    return {name: seconds * scale for name, seconds in shortest.items()}, compilation


def sample_seconds(integrator: SphereIntegrator, size: int) -> float:
    """Seconds of one sample in a launch of blocks of `size` samples, without compilation."""
    covered = int(np.count_nonzero(integrator.coverage))
    blocks = Blocks(size, max(2, MAX_LANES // (size * covered)))
    texels = next(blocks.launches(covered))
    frame, shortest = view_frame(np.array([1.0, 2.0, 3.0])), math.inf
    with backend.rendering(integrator.rendering):
        for run in range(-1, RUNS):
            start = time.perf_counter()
            integrator.launch(frame, texels, blocks.size, run + 1).means()
            if run >= 0:
                shortest = min(shortest, time.perf_counter() - start)
    return shortest / (len(texels) * blocks.size)


def map_overhead(integrator: SphereIntegrator) -> float:
    """Seconds of a map besides sampling: health check, compression, and sync to disk."""
    noisy = _noisy_map(integrator)
    start = time.perf_counter()
    map_health(noisy)
    encode_map(noisy)
    return SYNC_SECONDS + (time.perf_counter() - start) * _scale(integrator, noisy)


def map_bytes(integrator: SphereIntegrator) -> int:
    """Size of a map file [bytes], measured on a noisy map: noise dominates the compressed size."""
    noisy = _noisy_map(integrator)
    return round(len(encode_map(noisy)) * _scale(integrator, noisy))


def _scale(integrator: SphereIntegrator, trial: MapFile) -> float:
    """Texels of a map of the bake, for each texel of the trial."""
    return integrator.coverage.size / trial.coverage.size


def _noisy_map(integrator: SphereIntegrator) -> MapFile:
    """Map of four samples a texel, of the bake's resolution or `TRIAL_SIDE`."""
    if len(integrator.coverage) > TRIAL_SIDE:
        integrator = integrator.at_resolution(TRIAL_SIDE)
    frame = view_frame(np.array([1.0, 2.0, 3.0]))
    block = integrator.block(frame, 4, np.random.SeedSequence(0))
    layers = {name: integrator.image(block[:, k]) for k, name in enumerate(integrator.lobe_names)}
    variance = integrator.image(np.abs(block.sum(axis=1)))  # colours of spectral renderings may be negative
    return MapFile(frame[:, 2].copy(), frame, layers, variance, integrator.coverage, integrator.grey)

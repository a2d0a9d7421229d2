"""Forecast of a bake's bytes, memory and time, from its plan and a small trial map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rsibr.baking.blocks import block_sizes
from rsibr.baking.calibration import map_bytes, map_overhead, sample_seconds
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.scene import Scene
from rsibr.job_size import LARGE_BYTES, JobSize
from rsibr.planning.costs import Costs, priced
from rsibr.store.manifest import MAPS_NAME, SamplingRecord
from rsibr.store.map_file import map_channels

LIGHT_BYTES = 16 * 2**20
"""Upper bound on the file of the environment without an image of its own."""

TIMED_SAMPLES = 2**29
"""Samples of all texels from which the time of a bake is measured: some ten seconds of work on any machine."""

NOISY_SHARE = 0.75
"""Size of a compressed map as a share of its pixels, at most: 0.71 was measured under a photographed sky."""

_LANE_BYTES = 16
"""Random numbers and indices of a sample."""


def disk_and_memory(scene: Scene, out: Path) -> JobSize:
    """Bytes that a bake adds to the disk, and its peak memory; views that `out` holds already are subtracted.

    Parameters
    ----------
    scene : Scene
        Scene to bake.
    out : Path
        Directory of the bake.

    Notes
    -----
    Bytes of a large bake are those of the same map at no more than 256², noise included, scaled. Memory is an upper
    estimate: two launches, the sums and the file of one map.
    """
    integrator, views = scene.integrator, len(scene.viewpoints)
    lobes = len(integrator.lobe_names)
    raw = 4 * integrator.coverage.size * map_channels(lobes)
    size = map_bytes(integrator) if views * raw >= LARGE_BYTES else round(NOISY_SHARE * raw)
    costs = Costs(len(scene.all_around), lobes, 0.0, size)
    planned = LIGHT_BYTES + (priced(scene.plan, costs, scene.config.map.side).bytes or 0)
    here = sum(file.stat().st_size for file in (out / MAPS_NAME).glob("*.exr"))
    name = f"bake of {views} view{'s' * (views != 1)} of {scene.resolution}²"
    return JobSize(name, disk=max(0, planned - here), memory=bake_memory(integrator, scene.config.sampling.count))


def bake_memory(integrator: SphereIntegrator, samples: int) -> int:
    """Peak memory of a bake beyond that of its prepared scene [bytes]."""
    lobes, texels = len(integrator.lobe_names), int(np.count_nonzero(integrator.coverage))
    blocks = block_sizes(samples)
    lanes = min(integrator.max_lanes, texels * blocks.size * int(blocks.counts))
    launches = 2 * lanes * (4 * 3 * lobes + _LANE_BYTES)  # one computes while the results of the other are read
    order = 8 * texels * int(blocks.counts)  # texel of each block
    sums = 8 * texels * (3 * lobes + 4)  # float64: sum, squares, count
    return launches + order + sums + map_memory(integrator.coverage.size, lobes)


def map_memory(texels: int, lobes: int) -> int:
    """Memory to make and encode one map [bytes]: layers, sum, variance and coverage, as arrays and as a file."""
    return 3 * 4 * texels * map_channels(lobes)


def with_time(job: JobSize, scene: Scene, sampling: SamplingRecord, views: int) -> JobSize:
    """Add the time of the remaining `views` to a forecast, measured by small launches if the bake is long enough.

    Parameters
    ----------
    job : JobSize
        Bytes and memory.
    scene : Scene
        Scene to bake.
    sampling : SamplingRecord
        Samples as given or chosen.
    views : int
        Views that are still to bake.
    """
    texels = int(np.count_nonzero(scene.integrator.coverage))
    samples = views * texels * sampling.samples
    if samples < TIMED_SAMPLES:
        return job
    each = sample_seconds(scene.integrator, sampling.block)
    return replace(job, seconds=samples * each + views * map_overhead(scene.integrator))

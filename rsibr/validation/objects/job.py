"""Forecast of the memory and time of an object's validation."""

from __future__ import annotations

from collections.abc import Mapping

from rsibr.job_size import JobSize
from rsibr.methods.job import maps_memory
from rsibr.store.bake import Bake
from rsibr.validation.job import PREPARED
from rsibr.validation.objects.primary_rays import LANES_PER_LAUNCH, PrimaryRays

TRUTHS = 5
"""Truths of an object, see `rsibr.validation.objects.causes.Truths`."""
WORK = 15.0
"""Time of a sample of all five truths together over that of a sample of a bake; measured on a torus, two cores."""
COMPILE_SECONDS = 3.0
"""Time to load scenes and compile the kernels of the truths [s]."""
METHOD_SECONDS = 2.5
"""Time to prepare a method, to compile its kernels, and to judge its pictures [s]; mean over all listed methods."""
SHADOW_SECONDS = 1.6
"""Time that a method takes longer where its picture has shadows of its own [s].

It and `METHOD_SECONDS` are fitted to the processor time of a sphere and a torus, 128² pixels, two cores.
"""
LANE_BYTES = 150
"""Memory of a sample in a launch [bytes]."""
BUFFER_BYTES = 12
"""Memory of a pixel in a buffer of a truth [bytes]."""
JUDGED_BYTES = 900
"""Memory of a pixel while a picture is judged, and that which the report keeps [bytes]."""
FLIP_SECONDS = 2e-6
"""Time of HDR-FLIP a pixel [s]."""


def object_job(
    primary: PrimaryRays,
    bakes: Mapping[str, Bake],
    methods: int,
    samples: int,
    buffers: int,
    *,
    has_shadows: bool = False,
) -> JobSize:
    """Memory and time of an object's validation; time from the samples a second that the bakes reached.

    Parameters
    ----------
    primary : PrimaryRays
        Rays of the picture.
    bakes : mapping of str to Bake
        Bake of each type.
    methods, samples, buffers : int
        Methods; samples a pixel of each truth; independent buffers.
    has_shadows : bool
        Whether the pictures may have shadows of their own.
    """
    camera, covered = primary.camera, len(primary.pixels)
    pixels = camera.width * camera.height
    maps = sum(PREPARED * maps_memory(bake) for bake in {bake.path: bake for bake in bakes.values()}.values())
    kept = pixels * (BUFFER_BYTES * buffers * TRUTHS + JUDGED_BYTES)
    lanes = LANE_BYTES * min(LANES_PER_LAUNCH, covered * max(samples // buffers, primary.rays))
    rates = [rate for bake in bakes.values() if (rate := _samples_a_second(bake)) is not None]
    flips = FLIP_SECONDS * pixels * 2 * methods * (buffers + 1)
    judged = methods * (METHOD_SECONDS + SHADOW_SECONDS * has_shadows)
    seconds = COMPILE_SECONDS + WORK * covered * samples / min(rates) + judged + flips if rates else None
    name = f"validation of a picture of {camera.width}×{camera.height}"
    return JobSize(name, memory=round(maps + kept + lanes), seconds=seconds)


def _samples_a_second(bake: Bake) -> float | None:
    record, rendered = bake.manifest.sampling, bake.manifest.seconds
    if not record or not rendered:
        return None
    return bake.view_count * record.samples * bake.resolution**2 * _DISK / rendered


_DISK = 0.785  # share of a map's texels inside the disk

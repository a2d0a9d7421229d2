"""Forecast of a validation's memory and time, from the records of its bake."""

from __future__ import annotations

from rsibr.job_size import JobSize
from rsibr.methods.job import maps_memory
from rsibr.store.bake import Bake

PREPARED = 1.5
"""Memory of the maps prepared for all methods, as a multiple of that for the default method."""
WORK_BYTES = 800
"""Memory for each texel while a view is judged: buffers of the reference, metrics, lobes [bytes]."""
KEPT_BYTES = 60
"""Memory for each texel, view and method that the report needs: images and errors [bytes]."""


def validation_job(bake: Bake, views: int, methods: int, samples: int) -> JobSize:
    """Memory and time of a validation; time from the samples a second that the bake reached, and the references alone.

    Parameters
    ----------
    bake : Bake
        The bake.
    views, methods, samples : int
        Novel views, methods, and samples a texel of each reference.
    """
    texels = bake.resolution**2
    memory = PREPARED * maps_memory(bake) + texels * (WORK_BYTES + KEPT_BYTES * views * (methods + 1))
    record, rendered = bake.manifest.sampling, bake.manifest.seconds
    baked = bake.view_count * record.samples if record else 0
    seconds = views * samples * rendered / baked if baked else None
    name = f"validation of {views} view{'s' * (views != 1)} of {bake.resolution}²"
    return JobSize(name, memory=round(memory), seconds=seconds)

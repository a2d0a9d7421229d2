"""Rates of a forecast: processor time and bytes of the parts of a job, and what a job of any size takes by them.

    processor seconds of a job = pair + views × (view + texels × (store + samples × sample))
    bytes of a job             = beside + views × texels × bytes of a texel

and once for each worker `start`, once a material and worker `material`, once a sky and worker `sky`.
"""

from __future__ import annotations

from dataclasses import dataclass

from rsibr.batches.forecast.kinds import Size


@dataclass(frozen=True)
class Rates:
    """Cost of the parts of jobs of one group; processor times in seconds.

    Attributes
    ----------
    material : float
        A material that a worker meets for the first time: probes, fits, kernels.
    pair : float
        A bake in a worker that knows its material and its sky.
    view : float
        A map beside its texels.
    store : float
        A texel of a map: checked, compressed, written.
    sample : float
        A sample.
    then : float
        Steps after the bake, a texel of a map.
    beside : int
        Bytes of a bake beside its maps.
    files : int
        Files of a job beside its maps.
    then_bytes : float
        Bytes that the steps after the bake write, a texel of all maps.
    then_files : float
        Files that they write, a view.
    texel_bytes : float
        Bytes of a texel of a map.
    """

    material: float
    pair: float
    view: float
    store: float
    sample: float
    then: float
    beside: int
    files: int
    then_bytes: float
    then_files: float
    texel_bytes: float

    def job_seconds(self, size: Size) -> float:
        """Processor time of a bake whose worker knows material and sky [s]."""
        work = size.views * self.view + size.texels * self.store + size.samples_in_all * self.sample
        return self.pair + work + self.then * size.resolution**2

    def job_bytes(self, size: Size, map_bytes: float) -> float:
        """Bytes of a job whose maps have so many."""
        return self.beside + map_bytes + size.texels * self.then_bytes

    def job_files(self, size: Size) -> int:
        """Files of a job."""
        return self.files + size.views + round(size.views * self.then_files)


@dataclass(frozen=True)
class SharedRates:
    """Cost of what jobs share.

    Attributes
    ----------
    start : float
        A worker: its process, imports, first kernels [s].
    imports : float
        Part of it that a process has behind it which has checked the jobs [s].
    sky : float
        A sky that a worker meets for the first time [s].
    light_bytes : float
        A light file.
    lights : int
        Light files of a sky: materials share one, unless they need different parts of it.
    """

    start: float
    imports: float
    sky: float
    light_bytes: float
    lights: int

    def light_files(self, skies: int, jobs: int) -> int:
        """Number of light files of a batch."""
        return min(jobs, skies * self.lights)


TYPICAL = Rates(
    material=0.5,
    pair=0.2,
    view=0.015,
    store=6e-7,
    sample=1.5e-7,
    then=0.0,
    beside=40_000,
    files=4,
    then_bytes=0.0,
    then_files=0.0,
    texel_bytes=40.0,
)
"""Rates of a material of three lobes on a server's core, where nothing is measured."""

TYPICAL_SHARED = SharedRates(start=3.0, imports=1.2, sky=1.0, light_bytes=1.6e7, lights=1)

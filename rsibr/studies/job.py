"""Forecast of a study's bytes, memory and time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rsibr.baking.job import LIGHT_BYTES, NOISY_SHARE
from rsibr.job_size import JobSize
from rsibr.lobes.fit import MOST_GLOSSY
from rsibr.store.map_file import map_channels
from rsibr.studies.agenda import Agenda, BakeSize
from rsibr.studies.bench import Bench
from rsibr.studies.rates import view_count

MOST_LOBES = MOST_GLOSSY + 2
"""Lobes of a material: glossy ones, a matte one, a mirror."""

PREPARED_BYTES = 150
"""Memory of a stored texel, decoded and prepared for all methods [bytes]."""


def study_job(benches: Sequence[Bench], agenda: Agenda, seconds: float) -> JobSize:
    """Bytes of the missing bakes of a study, memory of its largest one, and the time of all steps.

    Where bakes do not stay, the largest counts, with as many lobes as a material may have: none is fitted to tell.
    """
    missing, keeps = [(bench, size) for bench in benches for size in _missing(bench, agenda)], _keeps(benches)
    texels = [view_count(bench.scene, size) * size.resolution**2 for bench, size in missing]
    lobes = [len(bench.scene.lobe_names) if keeps else MOST_LOBES for bench, _ in missing]
    sizes = [LIGHT_BYTES + NOISY_SHARE * 4 * count * map_channels(k) for count, k in zip(texels, lobes, strict=True)]
    disk = sum(sizes) if keeps else max(sizes, default=0)
    name = f"study of {len(missing)} bake{'s' * (len(missing) != 1)}"
    return JobSize(name, disk=round(disk), memory=PREPARED_BYTES * max(texels, default=0), seconds=seconds)


def _keeps(benches: Sequence[Bench]) -> bool:
    return benches[0].judged.judge.keep_bakes


def _missing(bench: Bench, agenda: Agenda) -> Iterator[BakeSize]:
    for size, variants in agenda.items():
        if any(bench.known_point(size, variant) is None for variant in variants):
            yield size

"""Forecast of a batch: core-hours, wall time on this machine, bytes and files, from probes or from typical rates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from rsibr import machine
from rsibr.batches.config import RunConfig
from rsibr.batches.document import ForecastRecord, KindRecord
from rsibr.batches.forecast.kinds import Census, Kind, Size
from rsibr.batches.forecast.probe import Planned, Probed
from rsibr.batches.forecast.rates import TYPICAL, TYPICAL_SHARED, Rates, SharedRates

OPEN = "{count} jobs have an error or a budget that decides on their size: it is taken as if nothing did"
MEAN = "{count} of {kinds} materials and their settings were probed; the others are taken as the mean of these"


_MEANS = ("material", "pair", "view", "store", "sample", "then", "then_bytes", "then_files", "texel_bytes")


@dataclass(frozen=True)
class _Cost:
    """Cost of the jobs of a kind: processor time and bytes of one, texels and files of its maps."""

    kind: Kind
    size: Size
    seconds: float
    bytes: float
    files: int


def forecast(
    census: Census, out: Path, run: RunConfig, probed: Probed | None, already_done: int, spent: float
) -> ForecastRecord:
    """Add up what the jobs of a census take.

    Parameters
    ----------
    census : Census
        Jobs that are still to run.
    out : Path
        Directory of the batch, whose free space counts.
    run : RunConfig
        Executor, workers and threads.
    probed : Probed or None
        Rates that were measured; None: typical ones.
    already_done : int
        Jobs that are done already.
    spent : float
        Processor time of finding and checking the jobs [s], which a run takes too.
    """
    workers = worker_count(run)
    costs = [_cost(kind, probed, run.threads) for kind in census.kinds]
    shared = probed.shared if probed else TYPICAL_SHARED
    processor = spent + _shared_seconds(census, costs, probed, shared, workers)
    if run.executor == "serial" and census.jobs:
        processor -= shared.imports  # the process that runs the jobs is the one that has checked them
    processor += sum(cost.kind.count * cost.seconds for cost in costs)
    lights = shared.light_files(census.skies, census.jobs)
    parallel = min(workers * run.threads, machine.usable_cores())
    longest = max((cost.seconds / run.threads for cost in costs), default=0.0)
    wall = spent + max((processor - spent) / parallel, longest) if costs else spent
    notes = list(probed.notes) if probed else []
    if probed and len(census.groups()) > len(probed.rates) + len(probed.notes):
        notes.append(MEAN.format(count=len(probed.rates), kinds=len(census.groups())))
    if count := sum(kind.count for kind in census.kinds if kind.is_open):
        notes.append(OPEN.format(count=count))
    return ForecastRecord(
        jobs=census.jobs,
        already_done=already_done,
        materials=census.materials,
        skies=census.skies,
        source="probes" if probed else "rates",
        processor_seconds=processor,
        seconds=wall,
        bytes=round(sum(cost.kind.count * cost.bytes for cost in costs) + lights * shared.light_bytes),
        files=sum(cost.kind.count * cost.files for cost in costs) + lights,
        free_bytes=machine.free_disk(out),
        executor=run.executor,
        workers=workers,
        threads=run.threads,
        kinds=[_record(cost) for cost in costs],
        notes=notes,
    )


def worker_count(run: RunConfig) -> int:
    """Workers on this machine."""
    if run.executor == "serial":
        return 1
    return run.workers or max(1, machine.usable_cores() // run.threads)


def _shared_seconds(
    census: Census, costs: list[_Cost], probed: Probed | None, shared: SharedRates, workers: int
) -> float:
    """Processor time of what a worker does once: for itself, and for each material and sky that it meets [s]."""
    busy = min(workers, census.jobs)
    jobs, rates = dict[str, int](), dict[str, Rates]()
    for cost in costs:
        jobs[cost.kind.material] = jobs.get(cost.kind.material, 0) + cost.kind.count
        rates.setdefault(cost.kind.material, _rates_of(cost.kind, probed))
    materials = sum(rates[name].material * min(busy, count) for name, count in jobs.items())
    met = min(busy, -(-census.jobs // max(census.skies, 1)))  # workers that meet a sky
    return busy * shared.start + materials + census.skies * met * shared.sky


def _cost(kind: Kind, probed: Probed | None, threads: int) -> _Cost:
    rates = _rates_of(kind, probed)
    planned = probed.planned.get(id(kind)) if probed else None
    if planned is None:
        planned = Planned(kind.size, kind.size.texels * rates.texel_bytes)
    seconds = rates.job_seconds(planned.size)
    if kind.seconds is not None:
        seconds = kind.seconds * threads + rates.then * planned.size.resolution**2
    size = planned.size
    return _Cost(kind, size, seconds, rates.job_bytes(size, planned.map_bytes), rates.job_files(size))


def _rates_of(kind: Kind, probed: Probed | None) -> Rates:
    """Rates of the kind's group, or the mean of all that were probed."""
    if probed is None:
        return TYPICAL
    if kind.group in probed.rates:
        return probed.rates[kind.group]
    every = list(probed.rates.values())
    return replace(
        every[0],
        **{name: sum(getattr(one, name) for one in every) / len(every) for name in _MEANS},
    )


def _record(cost: _Cost) -> KindRecord:
    size = cost.size
    return KindRecord(
        material=cost.kind.material,
        views=size.views,
        resolution=size.resolution,
        samples=size.samples,
        jobs=cost.kind.count,
        processor_seconds=cost.seconds,
        bytes=round(cost.bytes),
    )

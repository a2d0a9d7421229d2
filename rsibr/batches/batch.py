"""A batch from its file to its index: expand, check every job, forecast, run, index, gallery."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from rsibr.batches.config import BatchConfig, RunConfig, load_batch, parse_batch
from rsibr.batches.document import ForecastRecord
from rsibr.batches.events import Event
from rsibr.batches.executors.registry import executor_of
from rsibr.batches.forecast.forecast import forecast
from rsibr.batches.forecast.kinds import Census
from rsibr.batches.index import Index
from rsibr.batches.job import RESULTS_NAME, Job
from rsibr.batches.matrix import MOST_TOLD, Matrix, shard_bounds
from rsibr.batches.report import BatchReport, Tally, document_of
from rsibr.batches.resume import MANIFEST, DoneJobs
from rsibr.errors import BakeError, InputError
from rsibr.job_size import JobSize
from rsibr.progress import Progress


def batch(
    file: Path | str | Mapping[str, object],
    *,
    out: Path | str | None = None,
    overrides: Sequence[str] = (),
    only: Sequence[str] = (),
    executor: str | None = None,
    scheduler: str | None = None,
    shard: tuple[int, int] | None = None,
    dry_run: bool = False,
    probe: bool = True,
    on_progress: Callable[[Progress], None] = lambda _: None,
    on_forecast: Callable[[ForecastRecord], None] = lambda _: None,
    on_event: Callable[[Event], None] = lambda _: None,
    allow_large: bool = False,
) -> BatchReport:
    """Bake all jobs of a batch file; jobs that are done already do not run again.

    Parameters
    ----------
    file : path or mapping
        Batch file (TOML), or its tables; relative paths of tables start at the working folder.
    out : path, optional
        Directory of the batch; by default the file's name with the suffix `.batch`.
    overrides : sequence of str
        `key=value` pairs that override keys of the base config.
    only : sequence of str
        `KEY=VALUE`: only jobs with one of the values given for each key of the matrix; `name=PATTERN` selects by name.
    executor : str, optional
        "serial", "processes" or "dask"; by default the file's.
    scheduler : str, optional
        Address of a Dask scheduler, or "local".
    shard : (int, int), optional
        Number of a shard, from 1, and how many there are: consecutive jobs, all shards together have each once.
    dry_run : bool
        Find and check the jobs and forecast what they take; run none.
    probe : bool
        Whether a dry run measures small jobs; otherwise it adds up typical rates, and does not load Mitsuba.
    on_progress : callable
        Called while materials and skies are checked, and while jobs are probed.
    on_forecast : callable
        Called once before the first job, with a forecast from typical rates, or from probes for a dry run.
    on_event : callable
        Called with each event of the executor, see `rsibr.batches.events`.
    allow_large : bool
        Start even if the forecast exceeds the free disk space.

    Returns
    -------
    BatchReport
        `report.failed` has the jobs that failed; the others are whole.

    Raises
    ------
    InputError
        If anything in the file is wrong, for any job; nothing is baked then. If nothing is selected, or the bakes would
        not fit on the disk, unless `allow_large`.
    BakeError
        If `out` cannot be written, or another batch is writing into it.
    MachineError
        If the machine has no usable backend, or lacks what the executor needs.

    Examples
    --------
    >>> report = rsibr.batch("configs/batch_demo.toml", out="out/batch")                   # doctest: +SKIP
    >>> [(failed.name, failed.reason) for failed in report.failed]                         # doctest: +SKIP
    """
    config = load_batch(file) if isinstance(file, str | Path) else parse_batch(file)
    settings = config.tables.run.changed(executor=executor, scheduler=scheduler)
    executor_of(settings.executor)  # one that does not exist is a mistake in the file like any other
    work = _Work(
        config=config,
        settings=settings,
        out=Path(out) if out is not None else Path(f"{config.title}.batch"),
        overrides=overrides,
        only=only,
        shard=shard,
    )
    work.prepare(load=not dry_run or probe, on_progress=on_progress)
    found = work.forecast(dry_run and probe, on_progress)
    if dry_run:
        on_forecast(found)
        return work.forecast_report(found)
    if work.remaining:
        JobSize(f"batch of {work.remaining} bakes", disk=found.bytes).admit(work.out, allow_large)
        on_forecast(found)
        work.run(on_event)
    return work.report(found)


def reindex(out: Path | str, title: str = "batch") -> BatchReport:
    """Make the index and the gallery of a batch anew from its result files.

    Raises
    ------
    InputError
        If there are no results in `out`.
    MachineError, BakeError
        If a file cannot be written.
    """
    out, begun = Path(out), time.perf_counter()
    if not (out / RESULTS_NAME).is_dir():
        raise InputError("holds no results of a batch", where=str(out), fix="name the directory with --out")
    from rsibr.batches.overview import write_overview  # noqa: PLC0415  # reads maps, which loads Mitsuba

    index, gallery = write_overview(out, title)
    document = document_of(
        title,
        out,
        "indexed",
        jobs=index.done + index.failed,
        tally=Tally(index.done, index.seconds, index.bytes),
        index=index,
        gallery=gallery,
        seconds=time.perf_counter() - begun,
    )
    return BatchReport(document, out)


@dataclass
class _Work:
    """One run of a batch: its jobs, what is done of them, and how it ends."""

    config: BatchConfig
    settings: RunConfig
    out: Path
    overrides: Sequence[str]
    only: Sequence[str]
    shard: tuple[int, int] | None
    remaining: int = 0
    census: Census = field(default_factory=Census)
    _begun: float = field(default_factory=time.perf_counter)
    _spent: float = field(default_factory=lambda: sum(os.times()[:4]))
    _count: int = 0
    _obstacles: list[str] = field(default_factory=list)

    def prepare(self, *, load: bool, on_progress: Callable[[Progress], None]) -> None:
        """Find all jobs, check each distinct value, and count what is still to run.

        Parameters
        ----------
        load : bool
            Whether materials and skies are loaded with Mitsuba, too.
        on_progress : callable
            Called after each of these.
        """
        _check_place(self.out)
        self._matrix = Matrix.of(self.config, self.overrides, self.only)
        self._done = DoneJobs(self.out, {})
        if not load and self.shard is None:  # in one pass: the jobs of a large batch are seen once
            self._total = self._matrix.check(self._look)
        else:
            self._total = self._matrix.check()
            if load:
                from rsibr.batches.check import check_contents  # noqa: PLC0415  # loads Mitsuba

                self._done = DoneJobs(self.out, check_contents(self._matrix, on_progress))
            for job in self._jobs():
                self._look(job)
        if self._obstacles:
            more = len(self._obstacles) - MOST_TOLD
            told = "; ".join(self._obstacles[:MOST_TOLD]) + (f"; and {more} more" if more > 0 else "")
            raise BakeError(
                f"holds bakes of other jobs of the same names: {told}",
                where=str(self.out),
                fix="choose another --out, or delete them",
            )

    def forecast(self, probe: bool, on_progress: Callable[[Progress], None]) -> ForecastRecord:
        """Forecast of what is still to run, from probes or from typical rates."""
        spent, probed = sum(os.times()[:4]) - self._spent, None
        if probe and self.census.kinds:
            from rsibr.batches.forecast.probe import probe as measure  # noqa: PLC0415  # starts a process

            probed = measure(self.census, self.settings.threads, on_progress)
        return forecast(self.census, self.out, self.settings, probed, self._already_done, spent)

    def forecast_report(self, found: ForecastRecord) -> BatchReport:
        """Report of a dry run."""
        return BatchReport(
            document_of(
                self.config.title,
                self.out,
                "forecast",
                jobs=self._count,
                already_done=self._already_done,
                found=found,
                seconds=self._seconds,
            ),
            self.out,
        )

    def run(self, on_event: Callable[[Event], None]) -> None:
        """Run what is not done."""
        from rsibr.batches.coordinator import run_jobs  # noqa: PLC0415  # of the store, which loads Mitsuba

        pending = (job for job in self._jobs() if not self._done.has(job))
        run_jobs(pending, self.out, self.settings, on_event, shard=self.shard)

    def report(self, found: ForecastRecord) -> BatchReport:
        """Read the results; of a whole batch write the index and the gallery, which a shard leaves to the last."""
        tally = Tally.of(self.out, self._jobs(), self._command)
        index, gallery = (None, None) if self.shard else self._overview()
        document = document_of(
            self.config.title,
            self.out,
            "failed" if tally.failed else "done",
            jobs=self._count,
            already_done=self._already_done,
            tally=tally,
            found=found if self.remaining else None,
            index=index,
            gallery=gallery,
            seconds=self._seconds,
        )
        return BatchReport(document, self.out)

    def _overview(self) -> tuple[Index, Path]:
        from rsibr.batches.overview import write_overview  # noqa: PLC0415  # reads maps, which loads Mitsuba

        return write_overview(self.out, self.config.title, (job.name for job in self._jobs()))

    def _jobs(self) -> Iterator[Job]:
        """Jobs that are selected, or those of the shard."""
        if self.shard is None:
            return self._matrix.jobs()
        bounds = shard_bounds(self.shard, self._total)
        return islice(self._matrix.jobs(), bounds.start, bounds.stop)

    def _look(self, job: Job) -> None:
        """Count a job, and find what is in its way."""
        self._count += 1
        if self._done.has(job):
            return
        self.remaining += 1
        self.census.add(job)
        if obstacle := self._done.obstacle(job):
            self._obstacles.append(f"{job.name} ({obstacle} changed)")

    @property
    def _already_done(self) -> int:
        return self._count - self.remaining

    @property
    def _seconds(self) -> float:
        return time.perf_counter() - self._begun

    @property
    def _command(self) -> list[str]:
        """Command that repeats the batch; empty if it is no file."""
        if self.config.file is None:
            return []
        sets = [word for text in self.overrides for word in ("--set", text)]
        return ["rsibr", "batch", str(self.config.file), *sets, "--out", str(self.out)]


def _check_place(out: Path) -> None:
    """Refuse a directory that is no place for a batch."""
    if out.exists() and not out.is_dir():
        raise InputError("is a file; a batch is a directory", where=str(out), fix="choose another --out")
    if (out / MANIFEST).exists():
        raise InputError("is a bake; a batch is a directory of bakes", where=str(out), fix="choose another --out")

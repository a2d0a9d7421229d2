"""What became of a batch, as Python and `--json` have it."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rsibr.batches.document import BatchDocument, FailedRecord, ForecastRecord
from rsibr.batches.index import Index
from rsibr.batches.job import Job
from rsibr.batches.result import JobResult, read_result, read_results


@dataclass(frozen=True)
class BatchReport:
    """What became of a batch.

    Attributes
    ----------
    document : BatchDocument
        Counts, failures, forecast and files, as `rsibr batch --json` prints them.
    out : Path
        Directory of the batch.
    """

    document: BatchDocument
    out: Path

    @property
    def failed(self) -> list[FailedRecord]:
        """Jobs that failed, each with its reason and the command that repeats it."""
        return self.document.failed

    def results(self) -> Iterator[JobResult]:
        """Results of all jobs that have ever run in this directory."""
        yield from read_results(self.out)


@dataclass
class Tally:
    """Sums over the results of the jobs that were asked for."""

    done: int = 0
    seconds: float = 0.0
    bytes: int = 0
    failed: tuple[FailedRecord, ...] = ()

    @classmethod
    def of(cls, out: Path, jobs: Iterable[Job], command: Sequence[str]) -> Tally:
        """Read the result of each job; `command` repeats the batch, without a choice of jobs, or is empty."""
        found, failed = cls(), list[FailedRecord]()
        for job in jobs:
            result = read_result(out, job.name)
            if result is not None and result.answers(job):
                found.done += 1
                found.seconds += result.processor_seconds
                found.bytes += result.bytes
            else:
                failed.append(_failure(job, result, command))
        found.failed = tuple(failed)
        return found


def _failure(job: Job, result: JobResult | None, command: Sequence[str]) -> FailedRecord:
    repeats = shlex.join([*command, "--only", f"name={job.name}"]) if command else None
    if result is None or result.state == "done" or result.digest != job.digest:
        return FailedRecord(name=job.name, reason="did not run", signal=None, exit_code=None, command=repeats)
    return FailedRecord(
        name=job.name,
        reason=result.reason or "failed",
        signal=result.signal,
        exit_code=result.exit_code,
        command=repeats,
    )


def document_of(
    title: str,
    out: Path,
    state: Literal["forecast", "indexed", "done", "failed"],
    *,
    jobs: int,
    already_done: int = 0,
    tally: Tally | None = None,
    found: ForecastRecord | None = None,
    index: Index | None = None,
    gallery: Path | None = None,
    seconds: float,
) -> BatchDocument:
    """Document of a batch; what did not happen stays empty."""
    tally = tally or Tally()
    return BatchDocument(
        schema=1,
        batch=title,
        out=str(out),
        state=state,
        jobs=jobs,
        already_done=already_done,
        done=tally.done,
        failed=list(tally.failed),
        forecast=found,
        seconds=seconds,
        processor_seconds=tally.seconds,
        bytes=tally.bytes,
        index=[str(path) for path in index.files] if index else [],
        gallery=None if gallery is None else str(gallery),
        damaged=[str(path) for path in index.damaged] if index else [],
    )

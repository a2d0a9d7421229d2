"""Coordinator of a batch: holds its directory, and has an executor run its jobs. It needs no Mitsuba itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from rsibr.batches.batch_lock import Shard, batch_lock
from rsibr.batches.config import RunConfig
from rsibr.batches.events import Event, Note
from rsibr.batches.executors.registry import executor_of
from rsibr.batches.job import Job
from rsibr.batches.ledger import Ledger
from rsibr.store.atomic import unwritable


@dataclass(frozen=True)
class Ran:
    """Numbers of jobs that ran.

    Attributes
    ----------
    done, failed : int
        What became of them.
    """

    done: int
    failed: int


def run_jobs(
    jobs: Iterable[Job],
    out: Path,
    run: RunConfig,
    on_event: Callable[[Event], None] = lambda _: None,
    *,
    shard: Shard | None = None,
) -> Ran:
    """Run the jobs of a batch; the result of each is in `out/results` when it is over.

    Parameters
    ----------
    jobs : iterable of Job
        Jobs, read as they are needed. Jobs that are done are found done, after their inputs were looked at; leave out
        those that need not be.
    out : Path
        Directory of the batch; made if absent.
    run : RunConfig
        Executor, workers, threads and scheduler.
    on_event : callable
        Called with each event, in this thread.
    shard : pair of int, optional
        Index from 1 and number of shards, if `jobs` are those of a shard: other shards may run at once.

    Returns
    -------
    Ran

    Raises
    ------
    InputError
        If there is no such executor.
    BakeError
        If another process runs this batch.
    MachineError
        If the machine lacks something: no worker starts, Dask is not installed, its scheduler does not answer or is
        lost, the disk is full. What is whole is kept.
    """
    executor = executor_of(run.executor)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(out, error) from error
    with batch_lock(out, shard, lambda text: on_event(Note(text))):
        ledger = Ledger(jobs, out, on_event, workers=executor.workers(run), crowded=executor.crowded)
        executor.run(ledger, run)
    return Ran(ledger.done, ledger.failed)

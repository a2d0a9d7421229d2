"""Executor "serial": all jobs in this process, one after another.

A job that ends its process ends the batch with it. While a job is in hand, a mark is on the disk: the next run finds
it, and runs that job in a process of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from rsibr.batches.config import RunConfig
from rsibr.batches.executors.registry import register
from rsibr.batches.ledger import Death, Ledger
from rsibr.batches.tasks import Outcome, Task
from rsibr.batches.worker_process import run_alone
from rsibr.store.atomic import unwritable

IN_HAND = ".in-hand"
"""Suffix of the mark, which lies beside the result of its job."""

_NAME = "this process"


@register("serial")
class Serial:
    """Runs tasks in this process."""

    crowded = True

    def workers(self, run: RunConfig) -> int:  # noqa: ARG002  # of the protocol
        """One."""
        return 1

    def run(self, ledger: Ledger, run: RunConfig) -> None:
        """Run the tasks of a ledger; see `Executor`."""
        from rsibr.batches.worker import run_task  # noqa: PLC0415  # loads Mitsuba, which other executors do without

        ledger.worker_up(_NAME)
        while (task := ledger.next(_NAME)) is not None:
            mark = (ledger.out / task.job.result).with_suffix(IN_HAND)
            if mark.exists():
                task = replace(task, attempt=task.attempt + 1, alone=True)  # its next attempt
            ledger.started(task, _NAME)
            if task.alone:
                _run_apart(task, ledger, run.threads)
                mark.unlink(missing_ok=True)
                continue

            def report(share: float, task: Task = task) -> None:
                ledger.progressed(task, share)

            with _marked(mark):
                outcome = run_task(task, ledger.out, threads=run.threads, on_progress=report)
            ledger.ended(task, outcome)


@contextmanager
def _marked(mark: Path) -> Iterator[None]:
    """Leave a mark if the process dies in the block; not at Ctrl-C, which unwinds it."""
    try:
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()
    except OSError as error:
        raise unwritable(mark, error) from error
    try:
        yield
    finally:
        mark.unlink(missing_ok=True)


def _run_apart(task: Task, ledger: Ledger, threads: int) -> None:
    found = run_alone(task, ledger.out, threads)
    if isinstance(found, Death):
        ledger.died(task, found)
    else:
        ledger.ended(task, Outcome.from_record(found))

"""Executor "serial": all jobs in this process, one after another.

A job that ends its process ends the batch with it. The name of the job in hand is on the disk meanwhile: the next run
finds it, and runs that job in a process of its own.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from rsibr.batches.config import RunConfig
from rsibr.batches.executors.registry import register
from rsibr.batches.ledger import Death, Ledger
from rsibr.batches.tasks import Outcome, Task
from rsibr.batches.worker_process import run_alone
from rsibr.errors import RsibrError
from rsibr.store.atomic import read_bytes, write_atomic

IN_HAND = ".in-hand"
"""File in the directory of a batch that names the job which this process runs."""

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

        mark = ledger.out / IN_HAND
        suspect = _named(ledger)
        ledger.worker_up(_NAME)
        try:
            while (task := ledger.next(_NAME)) is not None:
                if task.job.name == suspect:
                    task, suspect = replace(task, attempt=2, alone=True), None  # its next attempt
                ledger.started(task, _NAME)
                if task.alone:
                    _run_apart(task, ledger, run.threads)
                    continue
                write_atomic(mark, task.job.name.encode())

                def report(share: float, task: Task = task) -> None:
                    ledger.progressed(task, share)

                ledger.ended(task, run_task(task, ledger.out, threads=run.threads, on_progress=report))
        finally:  # also at Ctrl-C: only a process that died in a job leaves the mark
            mark.unlink(missing_ok=True)


def _named(ledger: Ledger) -> str | None:
    with suppress(RsibrError):
        return read_bytes(ledger.out / IN_HAND, most=2**16).decode(errors="replace")
    return None


def _run_apart(task: Task, ledger: Ledger, threads: int) -> None:
    found = run_alone(task, ledger.out, threads)
    if isinstance(found, Death):
        ledger.died(task, found)
    else:
        ledger.ended(task, Outcome.from_record(found))

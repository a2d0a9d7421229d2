"""Executor "processes": workers of this machine, each a process of its own that is replaced when it dies."""

from __future__ import annotations

from contextlib import suppress
from multiprocessing.connection import wait

from rsibr import machine
from rsibr.batches.config import RunConfig
from rsibr.batches.executors.registry import register
from rsibr.batches.ledger import Ledger
from rsibr.batches.tasks import Outcome, Task
from rsibr.batches.worker_process import WorkerProcess
from rsibr.errors import MachineError


def worker_count(run: RunConfig) -> int:
    """Workers of this machine: as the batch asks, or one for each set of `threads` cores."""
    return run.workers or max(1, machine.usable_cores() // run.threads)


@register("processes")
class Processes:
    """Runs tasks in processes of this machine."""

    crowded = True

    def workers(self, run: RunConfig) -> int:
        """See `worker_count`."""
        return worker_count(run)

    def run(self, ledger: Ledger, run: RunConfig) -> None:
        """Run the tasks of a ledger; see `Executor`."""
        slots = [_Slot(f"worker {number + 1}", ledger, run.threads) for number in range(ledger.workers)]
        try:
            while not ledger.is_over:
                for slot in slots:
                    slot.take()
                busy = {slot.process.connection: slot for slot in slots if slot.process and slot.task}
                if not busy:
                    raise MachineError(
                        "no worker can go on", fix="see the notes above, then run the same command again"
                    )
                for connection in wait(list(busy)):
                    busy[connection].hear()  # type: ignore[index]
        finally:
            for slot in slots:
                slot.close()


class _Slot:
    """Place of a worker: a process while there is work, and the task that it has."""

    def __init__(self, name: str, ledger: Ledger, threads: int) -> None:
        self.name = name
        self.process: WorkerProcess | None = None
        self.task: Task | None = None
        self._ledger, self._threads = ledger, threads
        self._is_up = False

    def take(self) -> None:
        """Take the next task if there is none in hand; one that is to run alone gets a fresh process."""
        if self.task is not None:
            return
        self.task = self._ledger.next(self.name)
        if self.task is None:
            return
        if self.process is not None and self.task.alone and not self.process.is_fresh:
            self.close()
        if self.process is None:
            self.process = WorkerProcess()
        self.process.give(self.task, self._ledger.out, self._threads)
        if self._is_up:
            self._ledger.started(self.task, self.name)

    def hear(self) -> None:
        """Take the next message of the process."""
        assert self.process is not None
        assert self.task is not None
        message = self.process.receive()
        if message is None:
            self._died()
        elif "ready" in message:
            self._is_up = True
            self._ledger.worker_up(self.name)
            self._ledger.started(self.task, self.name)
        elif "share" in message:
            self._ledger.progressed(self.task, message["share"])
        else:
            task, self.task = self.task, None
            self._ledger.ended(task, Outcome.from_record(message["outcome"]))
            if task.alone:
                self.close()

    def _died(self) -> None:
        assert self.process is not None
        assert self.task is not None
        death, started, task = self.process.death(), self._is_up, self.task
        said = self.process.last_line() if not started else ""
        self.task = None
        self.close(str(death))
        if not started and death.signal is None:
            raise MachineError(f"a worker cannot start: {said or death}", fix="`rsibr doctor` checks this machine")
        self._ledger.died(task, death)

    def close(self, reason: str = "") -> None:
        """End the process."""
        if self.process is None:
            return
        with suppress(Exception):
            self.process.end()
        self.process = None
        if self._is_up:
            self._is_up = False
            self._ledger.worker_gone(self.name, reason)

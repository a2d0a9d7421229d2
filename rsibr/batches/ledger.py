"""Ledger of a running batch: what is to do next, and what to do about each end of a task; the same for all executors.

| a task | is followed by |
|---|---|
| ends with its process (segfault, `kill -9`, out of memory) | one more attempt, alone in a fresh process; after that it has failed, with the name of the signal |
| fails for want of something of the machine (a full disk) | one more attempt, on another worker; a worker that fails where others succeed, twice, gets no more tasks |
| fails otherwise | nothing: it would fail again |

Large bakes are split into tasks of some views, see `SPLIT_ABOVE`.
"""  # noqa: E501  # a table

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from rsibr import machine
from rsibr.batches.events import Event, Finished, Note, Progressed, Started, Stopped, WorkerGone, WorkerUp
from rsibr.batches.job import Job
from rsibr.batches.result import JobResult, write_result
from rsibr.batches.sections import view_count
from rsibr.batches.tasks import Outcome, Task
from rsibr.errors import MachineError, RsibrError
from rsibr.scene.config import ViewsConfig

SPLIT_ABOVE = 24
"""Views above which a bake may be split over several workers.

Each worker that takes part prepares the scene again, which costs as much as dozens of small views: measured were 3 s of
processor, and two workers that shared a bake of 12 views did 11 and 1 of them. So a bake is split only if it is larger,
and only where fewer jobs wait than there are workers, which would be idle otherwise.
"""

CHUNK = 12
"""Views of a task of a split bake."""

FULL = 2**24
"""Free bytes at the directory of the batch below which a machine's failure is everyone's, and the batch stops."""

MOST_LOST = 4
"""Attempts of a task whose workers are lost with no word of a signal, as when a cluster's time is over."""

_BLAMED = 2


@dataclass(frozen=True)
class Death:
    """End of the process of a task.

    Attributes
    ----------
    signal : str or None
        Name of the signal that ended it; None if it ended by itself, or its machine was lost.
    exit_code : int or None
        Exit code, if it ended by itself.
    said : str
        Last line that it wrote about itself; may be empty.
    lost : bool
        Whether the worker was lost, with no word of what ended it.
    """

    signal: str | None = None
    exit_code: int | None = None
    said: str = ""
    lost: bool = False

    def __str__(self) -> str:
        """Return signal or exit code."""
        if self.lost:
            return "its worker was lost"
        return self.signal or f"exit code {self.exit_code}"


@dataclass
class _Split:
    """Bake that is split: tasks that are not over, and the time of those that are."""

    job: Job
    open: int
    attempts: int
    seconds: float
    processor_seconds: float


@dataclass
class _Flight:
    """Task that a worker has."""

    task: Task
    worker: str
    since: float = field(default_factory=time.monotonic)


class Ledger:
    """Jobs of a batch: those that wait, those in flight, and what became of the others.

    Parameters
    ----------
    jobs : iterable of Job
        Jobs to run; read ahead by no more than the number of workers.
    out : Path
        Directory of the batch.
    on_event : callable
        Called with each event.
    workers : int
        Number of workers that there may be.
    crowded : bool
        Whether all workers share one machine: a task that is to run alone then waits until nothing else runs.

    Attributes
    ----------
    workers : int
        See above; may change.
    done, failed : int
        Numbers of jobs that are over.
    """

    def __init__(
        self, jobs: Iterable[Job], out: Path, on_event: Callable[[Event], None], *, workers: int, crowded: bool = True
    ) -> None:
        self.out, self.workers, self.crowded = out, workers, crowded
        self.done = self.failed = 0
        self._tell = on_event
        self._jobs: Iterator[Job] = iter(jobs)
        self._ahead: deque[Job] = deque()
        self._parts: deque[Task] = deque()
        self._retries: deque[Task] = deque()
        self._suspects: deque[Task] = deque()
        self._flights: dict[tuple[object, ...], _Flight] = {}
        self._splits: dict[str, _Split] = {}
        self._over: set[str] = set()
        self._last_job: dict[str, str] = {}
        self._blame: dict[str, int] = {}
        self._on_trial: dict[str, str] = {}
        self._up: set[str] = set()

    # ── what is to do ────────────────────────────────────────────────────────────────────────────────────────────────

    @property
    def is_over(self) -> bool:
        """Whether all jobs are over."""
        self._read_ahead()
        return not (self._ahead or self._parts or self._retries or self._suspects or self._flights)

    @property
    def in_flight(self) -> int:
        """Number of tasks that workers have."""
        return len(self._flights)

    def is_set_aside(self, worker: str) -> bool:
        """Whether a worker gets no more tasks."""
        return self._blame.get(worker, 0) >= _BLAMED

    def rests(self, worker: str) -> bool:
        """Whether a worker gets no tasks at the moment: it failed, and whether others do as well is being tried."""
        return self.is_set_aside(worker) or (worker in self._on_trial and any(self._others(worker)))

    def next(self, worker: str = "") -> Task | None:
        """Task for a worker, which is in flight from now on; None if there is none at the moment.

        Parameters
        ----------
        worker : str
            The worker that asks; empty if the engine chooses it. It goes on with the bake whose scene it has prepared.
        """
        if self.is_set_aside(worker):
            return None
        task = self._retry_for(worker)
        if task is None and not self.rests(worker):
            task = self._part_of(worker) or self._new() or self._part() or self._suspect()
        if task is not None:
            self._flights[task.key] = _Flight(task, worker)
        return task

    def _read_ahead(self) -> None:
        self._ahead.extend(islice(self._jobs, max(0, self.workers - len(self._ahead))))

    def _part_of(self, worker: str) -> Task | None:
        """Part of the bake that a worker has prepared; an end of any."""
        for task in self._parts:
            if task.step == "finish" or task.job.name == self._last_job.get(worker):
                self._parts.remove(task)
                return task
        return None

    def _part(self) -> Task | None:
        return self._parts.popleft() if self._parts else None

    def _retry_for(self, worker: str) -> Task | None:
        for task in self._retries:
            if task.avoid != worker or not any(self._others(worker)):
                self._retries.remove(task)
                return task
        return None

    def _others(self, worker: str) -> Iterator[str]:
        """Other workers that get tasks."""
        return (other for other in self._up if other != worker and not self.is_set_aside(other))

    def _suspect(self) -> Task | None:
        waits = self.crowded and (self._flights or self._retries)
        return None if waits or not self._suspects else self._suspects.popleft()

    def _new(self) -> Task | None:
        self._read_ahead()
        if not self._ahead:
            return None
        job = self._ahead.popleft()
        self._read_ahead()
        split = self.workers > 1 and len(self._ahead) < self.workers - 1 and is_large(job)
        return Task(job, "prepare" if split else "whole")

    # ── what became of it ────────────────────────────────────────────────────────────────────────────────────────────

    def worker_up(self, worker: str) -> None:
        """Note that a worker is there."""
        self._up.add(worker)
        self._tell(WorkerUp(worker))

    def worker_gone(self, worker: str, reason: str = "") -> None:
        """Note that a worker is gone."""
        self._up.discard(worker)
        self._tell(WorkerGone(worker, reason))

    def note(self, text: str) -> None:
        """Say something to the user."""
        self._tell(Note(text))

    def started(self, task: Task, worker: str) -> None:
        """Note that a worker has begun with a task."""
        flight = self._flights.get(task.key)
        if flight is not None:
            flight.worker, flight.since = worker, time.monotonic()
            self._last_job[worker] = task.job.name
            self._tell(Started(task.job.name, worker, task.part))

    def progressed(self, task: Task, share: float) -> None:
        """Note how far a task is."""
        flight = self._flights.get(task.key)
        if flight is not None:
            self._tell(Progressed(task.job.name, flight.worker, share))

    def ended(self, task: Task, outcome: Outcome, worker: str = "") -> None:
        """Note what became of a task.

        Parameters
        ----------
        task, outcome : Task, Outcome
        worker : str
            Who had it, where the engine chose that.

        Raises
        ------
        MachineError
            If the disk of the batch is full: no job can go on.
        """
        worker = worker or self._flights[task.key].worker
        self._landed(task)
        self._end_trial(task)
        if task.job.name in self._over:  # another part of it has failed meanwhile
            return
        result = outcome.result
        if result is not None and result.state == "failed":
            self._failed(task, outcome, result, worker)
            return
        if task.avoid and task.avoid != worker:
            self._to_blame(task.avoid, task.job.name)
        self._blame.pop(worker, None)
        if result is not None:
            self._finish(result)
        else:
            self._go_on(task, outcome)

    def died(self, task: Task, death: Death) -> None:
        """Note that a task ended with its process."""
        flight = self._landed(task)
        self._end_trial(task)
        if task.job.name in self._over:
            return
        seconds = time.monotonic() - flight.since
        if not task.alone or (death.lost and task.attempt < MOST_LOST):
            self._suspects.append(task.again(seconds, alone=True))
            self.note(f"{task.job.name}: its process ended ({death}); it will run once more, alone")
            return
        why = f"ended its process ({death}), and again in a fresh one that ran nothing else"
        result = JobResult.of(
            task.job,
            "failed",
            reason=f"{why}: {death.said}" if death.said else why,
            signal=death.signal,
            exit_code=death.exit_code,
            seconds=task.seconds + seconds,
            processor_seconds=task.processor_seconds,
            worker=flight.worker,
            attempts=task.attempt,
        )
        self._close(result)

    def _landed(self, task: Task) -> _Flight:
        flight = self._flights.pop(task.key)
        self._tell(Stopped(task.job.name, flight.worker))
        return flight

    def _end_trial(self, task: Task) -> None:
        """Let the worker go on whose failure this task has tried elsewhere."""
        if task.avoid and self._on_trial.get(task.avoid) == task.job.name:
            del self._on_trial[task.avoid]

    def _failed(self, task: Task, outcome: Outcome, result: JobResult, worker: str) -> None:
        if result.exit_code == MachineError.exit_code:
            self._require_space(result)
            if not task.avoid:
                self._retries.append(task.again(outcome.seconds, outcome.processor_seconds, avoid=worker))
                self._on_trial[worker] = task.job.name
                self.note(f"{task.job.name}: {result.reason} ({worker}); it will run once more")
                return
        self._close(result)

    def _require_space(self, result: JobResult) -> None:
        with suppress(OSError):
            if machine.free_disk(self.out) < FULL:
                raise MachineError(
                    f"the disk is full: {result.reason}",
                    where=str(self.out),
                    fix="free some space, then run the same command again: what is whole is kept",
                )

    def _to_blame(self, worker: str, job: str) -> None:
        """Count that a worker failed where another one succeeded."""
        self._blame[worker] = self._blame.get(worker, 0) + 1
        if self._blame[worker] == _BLAMED:
            self.note(f"{worker} gets no more jobs: {job} and another one failed there, and not elsewhere")

    def _go_on(self, task: Task, outcome: Outcome) -> None:
        """Queue what follows a part of a bake."""
        if task.step == "prepare":
            chunks = [outcome.pending[k : k + CHUNK] for k in range(0, len(outcome.pending), CHUNK)]
            self._splits[task.job.name] = _Split(
                task.job,
                len(chunks),
                task.attempt,
                task.seconds + outcome.seconds,
                task.processor_seconds + outcome.processor_seconds,
            )
            self._parts.extend(Task(task.job, "views", views) for views in chunks)
        else:
            split = self._splits[task.job.name]
            split.open -= 1
            split.attempts = max(split.attempts, task.attempt)
            split.seconds += task.seconds + outcome.seconds
            split.processor_seconds += task.processor_seconds + outcome.processor_seconds
        split = self._splits[task.job.name]
        if split.open == 0:
            end = Task(split.job, "finish", attempt=split.attempts)
            self._parts.append(end.after(split.seconds, split.processor_seconds))

    def _close(self, result: JobResult) -> None:
        """Record a failure; parts of its bake that wait are dropped."""
        for worker in [worker for worker, name in self._on_trial.items() if name == result.name]:
            del self._on_trial[worker]
        for queue in (self._parts, self._retries, self._suspects):
            kept = [task for task in queue if task.job.name != result.name]
            queue.clear()
            queue.extend(kept)
        try:
            write_result(self.out, result)
        except OSError as error:
            raise MachineError(f"cannot be written ({error.strerror})", where=str(self.out)) from error
        self._finish(result)

    def _finish(self, result: JobResult) -> None:
        if self._splits.pop(result.name, None) is not None:
            self._over.add(result.name)
        self.done += result.state == "done"
        self.failed += result.state == "failed"
        self._tell(Finished(result))


def is_large(job: Job) -> bool:
    """Whether a bake may be split; one with a budget of its own decides on its views first, in one process."""
    with suppress(RsibrError, ValueError, KeyError):
        return (
            "budget" not in job.settings and view_count(ViewsConfig.model_validate(job.settings["views"])) > SPLIT_ABOVE
        )
    return False

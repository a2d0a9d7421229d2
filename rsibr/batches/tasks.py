"""Unit of work that a worker is given, and what it returns: small JSON data. Bakes and results are on the disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal, Self

from pydantic import TypeAdapter

from rsibr.batches.job import Job
from rsibr.batches.result import JobResult

Step = Literal["whole", "prepare", "views", "finish"]
"""The whole job; or of a large bake its plan and light, some of its views, its end with the steps after it."""

_results = TypeAdapter(JobResult)


@dataclass(frozen=True)
class Task:
    """A job, or a part of one.

    Attributes
    ----------
    job : Job
        The job.
    step : Step
        What of it is to be done.
    views : tuple of int
        Views to bake, of the step "views".
    attempt : int
        Number of this attempt, from 1.
    alone : bool
        Whether it runs in a process that runs nothing else: the last one died with it.
    avoid : str
        Worker that it should not run on again: the machine failed there.
    seconds, processor_seconds : float
        Time that earlier attempts and other parts of the job have taken [s].
    """

    job: Job
    step: Step = "whole"
    views: tuple[int, ...] = ()
    attempt: int = 1
    alone: bool = False
    avoid: str = ""
    seconds: float = 0.0
    processor_seconds: float = 0.0

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from all other tasks, whichever attempt it is."""
        return self.job.name, self.step, self.views

    @property
    def part(self) -> str:
        """What it does, for a table; empty for a whole job."""
        if self.step == "views":
            return f"{len(self.views)} views"
        return "" if self.step == "whole" else self.step

    def after(self, seconds: float, processor_seconds: float) -> Task:
        """Return the task with these times added to those of what came before it [s]."""
        return replace(
            self, seconds=self.seconds + seconds, processor_seconds=self.processor_seconds + processor_seconds
        )

    def again(self, seconds: float, processor_seconds: float = 0.0, *, alone: bool = False, avoid: str = "") -> Task:
        """Return the next attempt, after one that took these times [s]."""
        spent = self.after(seconds, processor_seconds)
        return replace(spent, attempt=self.attempt + 1, alone=self.alone or alone, avoid=avoid)

    def to_record(self) -> dict[str, Any]:
        """Return the task as JSON data; `from_record` reads it back."""
        own = {name: value for name, value in vars(self).items() if name not in ("job", "views")}
        return {**own, "job": self.job.to_record(), "views": list(self.views)}

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """Read a task from the data that `to_record` returns."""
        return cls(**{**record, "job": Job.from_record(record["job"]), "views": tuple(record["views"])})


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Attributes
    ----------
    result : JobResult or None
        Result of the job if it is over: failed, or its last step is done.
    pending : tuple of int
        Views that are still to bake, after the step "prepare".
    seconds, processor_seconds : float
        Time of this attempt [s].
    """

    result: JobResult | None = None
    pending: tuple[int, ...] = field(default=())
    seconds: float = 0.0
    processor_seconds: float = 0.0

    def to_record(self) -> dict[str, Any]:
        """Return the outcome as JSON data; `from_record` reads it back."""
        result = None if self.result is None else asdict(self.result) | {"asked": self.result.asked.to_record()}
        return {**vars(self), "result": result, "pending": list(self.pending)}

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """Read an outcome from the data that `to_record` returns."""
        result = None if record["result"] is None else _results.validate_python(record["result"])
        return cls(**{**record, "result": result, "pending": tuple(record["pending"])})

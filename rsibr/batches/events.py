"""Events of a running batch: what its table shows."""

from __future__ import annotations

from dataclasses import dataclass

from rsibr.batches.result import JobResult


@dataclass(frozen=True)
class WorkerUp:
    """A worker is there.

    Attributes
    ----------
    worker : str
        Its name: "worker 1" of this machine, or what a cluster calls it.
    """

    worker: str


@dataclass(frozen=True)
class WorkerGone:
    """A worker is gone.

    Attributes
    ----------
    worker : str
        Its name.
    reason : str
        Name of the signal that ended it, or its exit code; empty at the regular end.
    """

    worker: str
    reason: str = ""


@dataclass(frozen=True)
class Started:
    """A worker has begun with a job, or with some views of one.

    Attributes
    ----------
    job, worker : str
        Names.
    part : str
        What it does: "" for the whole job, otherwise a step such as "12 of 162 views".
    """

    job: str
    worker: str
    part: str = ""


@dataclass(frozen=True)
class Progressed:
    """A worker is further.

    Attributes
    ----------
    job, worker : str
        Names.
    share : float
        Completed fraction of what it began, in [0, 1].
    """

    job: str
    worker: str
    share: float


@dataclass(frozen=True)
class Stopped:
    """A worker has ended a job, or a part of one; whether the job is over, `Finished` tells.

    Attributes
    ----------
    job, worker : str
        Names.
    """

    job: str
    worker: str


@dataclass(frozen=True)
class Finished:
    """A job is over.

    Attributes
    ----------
    result : JobResult
        What became of it.
    """

    result: JobResult


@dataclass(frozen=True)
class Note:
    """Something that the user should know, in one line.

    Attributes
    ----------
    text : str
        The line.
    """

    text: str


Event = WorkerUp | WorkerGone | Started | Progressed | Stopped | Finished | Note

"""Result of a job: one JSON file a job, written atomically by the process that ran it. The index is made from them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import TypeAdapter, ValidationError

from rsibr.batches.job import RESULTS_NAME, Job, Then, result_path
from rsibr.errors import RsibrError
from rsibr.store.atomic import read_bytes, write_atomic

LARGEST_RESULT = 2**20
"""Bytes above which a file is no result."""


@dataclass(frozen=True)
class JobResult:
    """What became of a job.

    Attributes
    ----------
    name : str
        Name of the job.
    state : {"done", "failed"}
        Whether the bake and all steps after it are finished.
    reason : str, optional
        Why it failed, in one line.
    signal : str, optional
        Name of the signal that ended its process, such as "SIGSEGV".
    exit_code : int, optional
        Exit code of a failure, as `rsibr bake` would return it.
    bake : str
        Path of the bake, relative to the directory of the batch.
    digest : str
        Digest of the job's settings.
    values : dict
        The job's value of each key of the matrix.
    asked : Then
        Steps after the bake that were asked for.
    contents : dict of str to str
        Digests of the content of "environment" and "material", from the manifest of the bake.
    seconds, processor_seconds : float
        Wall time and processor time of all attempts [s].
    bytes, views : int
        Size of the bake's directory [bytes], and its number of views.
    error : float, optional
        Worst relMSE of `[then] validate` over the judged views, of the method `rsibr`.
    noise : float, optional
        Mean relMSE of the noise of the stored maps.
    worker : str
        Machine and process that ran it.
    attempts : int
        Number of attempts.
    finished_at : str
        Time of the end, ISO 8601 in UTC.
    then : dict
        What each step after the bake wrote: `{"validate": {"report": PATH}, "publish": {FORMAT: [PATH, …]}}`, paths
        relative to the directory of the batch.
    """

    name: str
    state: Literal["done", "failed"]
    reason: str | None = None
    signal: str | None = None
    exit_code: int | None = None
    bake: str = ""
    digest: str = ""
    values: dict[str, Any] = field(default_factory=dict)
    asked: Then = field(default_factory=Then)
    contents: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    processor_seconds: float = 0.0
    bytes: int = 0
    views: int = 0
    error: float | None = None
    noise: float | None = None
    worker: str = ""
    attempts: int = 1
    finished_at: str = ""
    then: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, job: Job, state: Literal["done", "failed"], **fields: Any) -> Self:
        """Result of a job that ends now: name, bake, digest, values and steps are the job's."""
        known = {"name": job.name, "bake": job.bake, "digest": job.digest, "asked": job.then}
        return cls(state=state, **{**known, "values": dict(job.values), "finished_at": utc_now(), **fields})

    def answers(self, job: Job) -> bool:
        """Whether this is a finished result of exactly this job."""
        return self.state == "done" and self.digest == job.digest and self.asked == job.then


_reader = TypeAdapter(JobResult)


def utc_now() -> str:
    """Time of day, ISO 8601 in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def write_result(out: Path, result: JobResult) -> Path:
    """Write `out/results/NAME.json`, atomically.

    Raises
    ------
    MachineError, BakeError
        If it cannot be written.
    """
    path = out / result_path(result.name)
    path.parent.mkdir(parents=True, exist_ok=True)
    data = asdict(result) | {"asked": result.asked.to_record()}
    write_atomic(path, (json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode())
    return path


def read_result(out: Path, name: str) -> JobResult | None:
    """Read the result of a job; None if there is none or its file is damaged."""
    return _read(out / result_path(name), name)


def read_results(out: Path, on_damaged: Callable[[Path], None] = lambda _: None) -> Iterator[JobResult]:
    """Read the results in the directory of a batch, sorted by path.

    Parameters
    ----------
    out : Path
        Directory of the batch.
    on_damaged : callable
        Called with the path of each file that is no result of the job that its path names; such files are skipped.
    """
    folder = out / RESULTS_NAME
    for path in sorted(folder.rglob("*.json")):
        name = path.relative_to(folder).as_posix().removesuffix(".json")
        result = _read(path, name)
        if result is None:
            on_damaged(path)
        else:
            yield result


def _read(path: Path, name: str) -> JobResult | None:
    try:
        result = _reader.validate_json(read_bytes(path, LARGEST_RESULT))
    except (ValidationError, RsibrError):
        return None
    return result if result.name == name else None

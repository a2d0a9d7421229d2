"""Work on a task, in any process: pure apart from the files of its job, and of the same bytes however often it runs."""

from __future__ import annotations

import os
import resource
import socket
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import drjit as dr

from rsibr import backend
from rsibr.baking.units import bake_unit, finish, prepare
from rsibr.batches.job import Job
from rsibr.batches.result import JobResult, read_result, write_result
from rsibr.batches.tasks import Outcome, Task
from rsibr.batches.then import run_steps
from rsibr.budget.bake import bake
from rsibr.budget.promise import promises_of
from rsibr.errors import BakeError, CheckFailed, MachineError, RsibrError
from rsibr.progress import Progress
from rsibr.scene.config import Config, parse_config
from rsibr.store.atomic import unwritable
from rsibr.store.bake import Bake
from rsibr.store.directory import lock_directory
from rsibr.store.manifest import LIGHTS_NAME

LONGEST_WAIT = 600.0
"""Time that a job waits for another process which bakes it [s]: one whose coordinator or scheduler was lost."""

_WAIT = 0.5
_BUG = 70
"""Exit code of a job that met a bug; `EX_SOFTWARE` of sysexits.h."""

_Made = TypeVar("_Made")

Report = Callable[[float], None]
"""Called with the completed fraction of a task."""


def run_job(job: Job, out: Path, *, threads: int = 1, on_progress: Report = lambda _: None) -> JobResult:
    """Bake a job, run the steps after it, and write its result. Never raises for a job that fails.

    A job that is done is found done; a bake that was killed goes on where it was.

    Parameters
    ----------
    job : Job
        The job.
    out : Path
        Directory of the batch.
    threads : int
        Threads of Dr.Jit meanwhile.
    on_progress : callable
        Called with the completed fraction of the bake.

    Returns
    -------
    JobResult
        As it stands in `out/results`, unless a failure kept it from being written.
    """
    outcome = run_task(Task(job), out, threads=threads, on_progress=on_progress)
    assert outcome.result is not None
    return outcome.result


def run_task(task: Task, out: Path, *, threads: int = 1, on_progress: Report = lambda _: None) -> Outcome:
    """Run a job, or a part of one; see `run_job`."""
    watch = _Watch.start()
    try:
        with _pool_of(threads):
            done = _STEPS[task.step](task, out, on_progress)
    except RsibrError as error:
        return _failure(task, out, watch, str(error), error.exit_code)
    except MemoryError:
        return _failure(task, out, watch, "out of memory. Lower map.resolution, or free memory", MachineError.exit_code)
    except SystemExit as error:  # of a plugin: a worker goes on
        return _failure(task, out, watch, f"something in it called sys.exit({error.code!r})", _BUG)
    except Exception as error:
        place = _write_traceback(task.job, out)
        what = " ".join(f"{type(error).__name__}: {error}".split())
        return _failure(task, out, watch, f"{what} (a bug, or one of a plugin: see {place})", _BUG)
    return watch.outcome(done) if isinstance(done, tuple) else _success(task, out, watch, done)


@dataclass(frozen=True)
class _Watch:
    """Wall and processor time since a task began."""

    wall: float
    processor: float

    @classmethod
    def start(cls) -> _Watch:
        return cls(time.perf_counter(), processor_seconds())

    @property
    def seconds(self) -> float:
        return max(0.0, time.perf_counter() - self.wall)  # never negative, even if the clock jumps

    @property
    def processor_seconds(self) -> float:
        return processor_seconds() - self.processor

    def outcome(self, pending: tuple[int, ...] = (), result: JobResult | None = None) -> Outcome:
        return Outcome(result, pending, self.seconds, self.processor_seconds)

    def spent(self, task: Task) -> dict[str, Any]:
        """Fields of a result: time of all attempts, their number, and who ended the last one."""
        return {
            "seconds": task.seconds + self.seconds,
            "processor_seconds": task.processor_seconds + self.processor_seconds,
            "attempts": task.attempt,
            "worker": worker_name(),
        }


@dataclass(frozen=True)
class _Done:
    """A finished bake and what the steps after it made, or the result that an earlier attempt has written."""

    bake: Bake
    then: dict[str, Any]
    error: float | None


def worker_name() -> str:
    """Machine and process."""
    return f"{socket.gethostname()}:{os.getpid()}"


def processor_seconds() -> float:
    """Processor time of this process and of the ended ones that it has started [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def _whole(task: Task, out: Path, on_progress: Report) -> _Done | JobResult:
    path = _place_of(task.job, out)
    return _finished(task.job, _baked(_config(task.job), path, out / LIGHTS_NAME, on_progress), out)


def _finished(job: Job, made: Bake, out: Path) -> _Done | JobResult:
    """Run the steps after a bake, unless an earlier attempt has, and was ended before it could say so."""
    known = read_result(out, job.name)
    if known is not None and known.answers(job) and known.contents == _contents(made):
        return known
    then, error = run_steps(job, made, out)
    for promise in promises_of(made.manifest):
        if not promise.kept:
            raise CheckFailed(f"baked, with a broken promise: {promise}")
    return _Done(made, then, error)


def _prepare(task: Task, out: Path, on_progress: Report) -> tuple[int, ...]:  # noqa: ARG001  # of all steps
    path = _place_of(task.job, out)
    return _in_turn(path, lambda: prepare(_config(task.job), path, lights=out / LIGHTS_NAME)).pending


def _views(task: Task, out: Path, on_progress: Report) -> tuple[int, ...]:
    already = len(task.views)

    def report(state: Progress) -> None:
        on_progress(1.0 - (state.total - state.done) / already)  # of the whole bake, so many views are left

    bake_unit(out / task.job.bake, task.views, on_progress=report)
    return ()


def _finish(task: Task, out: Path, on_progress: Report) -> _Done | JobResult:  # noqa: ARG001
    path = out / task.job.bake
    return _finished(task.job, _in_turn(path, lambda: finish(path)), out)


_STEPS: dict[str, Callable[[Task, Path, Report], _Done | JobResult | tuple[int, ...]]] = {
    "whole": _whole,
    "prepare": _prepare,
    "views": _views,
    "finish": _finish,
}


def _config(job: Job) -> Config:
    return parse_config(job.settings, Path(), where=job.name)


def _place_of(job: Job, out: Path) -> Path:
    path = out / job.bake
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path.parent, error) from error
    return path


def _baked(config: Config, path: Path, lights: Path, on_progress: Report) -> Bake:
    def work() -> Bake:
        return bake(config, out=path, lights=lights, on_progress=lambda state: on_progress(state.done / state.total))

    return _in_turn(path, work)


def _in_turn(path: Path, work: Callable[[], _Made]) -> _Made:
    """Do work on a bake after whoever else writes it: a worker whose coordinator was lost may still be at it."""
    deadline = time.monotonic() + LONGEST_WAIT
    while True:
        try:
            return work()
        except BakeError:
            if not _is_being_written(path) or time.monotonic() > deadline:
                raise
        time.sleep(_WAIT)


def _is_being_written(path: Path) -> bool:
    try:
        lock_directory(path).release()
    except RsibrError:
        return path.is_dir()
    return False


@contextmanager
def _pool_of(threads: int) -> Iterator[None]:
    """Give Dr.Jit so many threads inside the block."""
    backend.use()
    before = dr.thread_count()
    if threads == before:
        yield
        return
    dr.set_thread_count(threads)
    try:
        yield
    finally:
        dr.set_thread_count(before)


def _contents(made: Bake) -> dict[str, str]:
    return {kind: made.manifest.identity[kind]["content"] for kind in ("environment", "material")}


def _success(task: Task, out: Path, watch: _Watch, done: _Done | JobResult) -> Outcome:
    if isinstance(done, JobResult):
        return watch.outcome(result=done)
    made = done.bake
    result = JobResult.of(
        task.job,
        "done",
        contents=_contents(made),
        bytes=sum(file.stat().st_size for file in made.path.rglob("*") if file.is_file()),
        views=made.view_count,
        error=done.error,
        noise=made.manifest.noise,
        then=done.then,
        **watch.spent(task),
    )
    try:
        write_result(out, result)
    except RsibrError as error:
        return _failure(task, out, watch, str(error), error.exit_code)
    return watch.outcome(result=result)


def _failure(task: Task, out: Path, watch: _Watch, reason: str, exit_code: int) -> Outcome:
    result = JobResult.of(task.job, "failed", reason=reason, exit_code=exit_code, **watch.spent(task))
    with suppress(RsibrError, OSError):  # a full disk is the reason already; whoever gets the outcome has it
        write_result(out, result)
    return watch.outcome(result=result)


def _write_traceback(job: Job, out: Path) -> Path:
    """Keep the traceback of a bug beside the result."""
    path = (out / job.result).with_suffix(".traceback.txt")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(traceback.format_exc(), encoding="utf-8")
    return path

"""Executors: the same bytes from each, also after a kill, and one job that fails costs no other."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import psutil  # comes with Dask
import pytest

from rsibr.batches.config import RunConfig
from rsibr.batches.coordinator import run_jobs
from rsibr.batches.events import Finished, Note, Progressed, Started, WorkerGone
from rsibr.batches.executors import dask as dask_executor
from rsibr.batches.executors import registry
from rsibr.batches.executors.registry import executor_names, executor_of
from rsibr.batches.executors.serial import IN_HAND
from rsibr.batches.result import read_result
from rsibr.errors import InputError, MachineError
from tests.batches.jobs import digests, job

TWO = RunConfig(executor="processes", workers=2)
DASK = RunConfig(executor="dask", workers=2)
SERIAL = RunConfig(executor="serial")
ROOT = Path(__file__).parents[2]

COORDINATOR = """
import json, sys
from pathlib import Path
from rsibr.batches.config import RunConfig
from rsibr.batches.coordinator import run_jobs
from rsibr.batches.events import Event
from rsibr.batches.job import Job

asked = json.load(sys.stdin)
shard = tuple(asked["shard"]) if asked["shard"] else None
tell = lambda event: print(type(event).__name__, flush=True)
run_jobs(map(Job.from_record, asked["jobs"]), Path(asked["out"]), RunConfig(**asked["run"]), tell, shard=shard)
"""


class Told:
    """Events of a run, and what to do at the first of a kind."""

    def __init__(self, at: type | None = None, act=lambda: None) -> None:
        self.events, self._at, self._act = [], at, act

    def __call__(self, event) -> None:
        self.events.append(event)
        if self._at is not None and isinstance(event, self._at):
            self._at = None
            self._act()

    def results(self):
        return {event.result.name: event.result for event in self.events if isinstance(event, Finished)}

    def starts(self):
        return Counter(event.job for event in self.events if isinstance(event, Started))

    def notes(self):
        return [event.text for event in self.events if isinstance(event, Note)]


def workers_of(pid: int | None = None) -> list[psutil.Process]:
    """Worker processes below a process: of `processes`, or of a Dask cluster on this machine."""
    found = []
    for one in psutil.Process(pid).children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if any(name in " ".join(one.cmdline()) for name in ("worker_main", "spawn_main")):
                found.append(one)
    return found


def kill_one() -> None:
    workers_of()[-1].kill()


class Coordinator:
    """Coordinator in a process of its own."""

    def __init__(self, jobs, out, run, shard=None) -> None:
        import json

        asked = {"jobs": [one.to_record() for one in jobs], "out": str(out), "run": run.model_dump(), "shard": shard}
        self.process = subprocess.Popen(
            [sys.executable, "-c", COORDINATOR],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            text=True,
        )
        self.process.stdin.write(json.dumps(asked))
        self.process.stdin.close()

    def until(self, event: str) -> None:
        for line in self.process.stdout:
            if line.strip() == event:
                return
        raise AssertionError(f"ended before {event}: {self.process.stderr.read()}")

    def end(self, number: int) -> float:
        """Send a signal, and wait until it and its workers are gone; returns how long that took."""
        workers, begun = workers_of(self.process.pid), time.monotonic()
        self.process.send_signal(number)
        self.process.wait(30)
        psutil.wait_procs(workers, timeout=30)
        assert not any(one.is_running() for one in workers)
        self.close()
        return time.monotonic() - begun

    def close(self) -> None:
        self.process.stdout.close()
        self.process.stderr.close()


@pytest.fixture(scope="module")
def four(asymmetric_environment):
    """2 × 2 jobs at 32²."""
    size = {"map": {"resolution": 32}}
    return [
        job(f"{name}/{seed}", asymmetric_environment, name, sampling={"samples": 16, "seed": seed}, **size)
        for name in ("matte-lambert", "solid-red")
        for seed in (0, 1)
    ]


@pytest.fixture(scope="module")
def undisturbed(four, tmp_path_factory):
    """Digests of the four, one after the other in this process."""
    out = tmp_path_factory.mktemp("undisturbed")
    told = Told()
    ran = run_jobs(four, out, SERIAL, told)
    assert (ran.done, ran.failed) == (4, 0)
    assert not (out / IN_HAND).exists()
    found = digests(out)
    assert len({digest for path, digest in found.items() if "/maps/" in path}) == 4 * 12
    return found


def test_executors_are_found_by_name():
    assert executor_names() == ["dask", "processes", "serial"]
    with pytest.raises(InputError, match=r"unknown executor 'proceses'\. Did you mean 'processes'"):
        executor_of("proceses")


def test_an_executor_of_ones_own_runs_as_its_page_has_it(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "_REGISTERED", {**registry._REGISTERED})
    page = (ROOT / "docs" / "how-to" / "batch-faults.md").read_text(encoding="utf-8")
    exec(page.rpartition("```python\n")[2].partition("```")[0], {})
    told = Told()
    assert run_jobs([job("a", None)], tmp_path, RunConfig(executor="here"), told).done == 1
    assert [type(event).__name__ for event in told.events] == ["WorkerUp", "Started", "Stopped", "Finished"]


def test_a_coordinator_loads_no_mitsuba():
    code = (
        "import sys; from rsibr.batches.coordinator import run_jobs; from rsibr.batches.executors.registry import *\n"
        "executor_of('processes'), executor_of('dask')\n"
        "print([name for name in ('mitsuba', 'drjit', 'numpy', 'scipy', 'distributed') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_jobs_are_no_work(tmp_path):
    assert run_jobs([], tmp_path, TWO).done == 0


def test_without_dask_there_is_one_clear_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MachineError, match=r'Dask is not installed\. Install it with `pip install "rsibr\[batch\]"`'):
        run_jobs([], tmp_path, DASK)


def test_a_scheduler_that_does_not_answer_is_one_clear_line(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_executor, "CONNECT", 1.0)
    run = RunConfig(executor="dask", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(MachineError, match=r"tcp://127.0.0.1:9: no Dask scheduler answers within 1 s"):
        run_jobs([], tmp_path, run)
    with pytest.raises(InputError, match="is no address of a scheduler"):
        run_jobs([], tmp_path, RunConfig(executor="dask", scheduler="nonsense://here"))


@pytest.mark.slow
@pytest.mark.parametrize("run", [TWO, DASK], ids=["processes", "dask"])
def test_a_worker_killed_in_a_kernel_costs_nothing(four, undisturbed, tmp_path, run):
    told = Told(Progressed, kill_one)
    ran = run_jobs(four, tmp_path, run, told)
    assert (ran.done, ran.failed) == (4, 0)
    assert any(isinstance(event, WorkerGone) and event.reason for event in told.events)
    assert digests(tmp_path) == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize(("run", "shard"), [(TWO, None), (SERIAL, (1, 2))], ids=["processes", "shard"])
def test_a_killed_coordinator_is_resumed_without_baking_anything_twice(four, undisturbed, tmp_path, run, shard):
    mine = four[:2] if shard else four
    first = Coordinator(mine, tmp_path, run, shard)
    first.until("Finished")
    first.until("Started" if run is SERIAL else "Progressed")
    assert first.end(signal.SIGKILL) < 5.0
    before = {
        path: path.stat().st_mtime_ns
        for one in mine
        for path in (tmp_path / one.bake).glob("maps/*")
        if read_result(tmp_path, one.name)
    }
    assert before
    told = Told()
    assert run_jobs(mine, tmp_path, SERIAL, told, shard=shard).done == len(mine)
    if shard:
        assert run_jobs(four[2:], tmp_path, SERIAL, shard=(2, 2)).done == 2
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert digests(tmp_path) == undisturbed
    assert not (tmp_path / IN_HAND).exists()


@pytest.mark.slow
def test_sigterm_ends_the_workers_in_time_and_leaves_what_can_be_resumed(asymmetric_environment, tmp_path):
    long = job("a", asymmetric_environment, "solid-red", map={"resolution": 256}, sampling={"samples": 4096})
    first = Coordinator([long], tmp_path, TWO)
    first.until("Progressed")  # it is in its kernels
    assert first.end(signal.SIGTERM) < 5.0
    shutil.rmtree(tmp_path / long.bake)  # it would take a while
    assert run_jobs([job("b", None)], tmp_path, SERIAL).done == 1  # no lock is left


@pytest.mark.slow
def test_one_segfaulting_material_among_six(asymmetric_environment, tmp_path):
    jobs = [
        job(f"good-{number}", asymmetric_environment, sampling={"samples": 4, "seed": number}) for number in range(5)
    ]
    jobs.insert(1, job("bad", asymmetric_environment, {"folder": tmp_path, "habit": "segfault"}))
    told, out = Told(), tmp_path / "out"
    ran = run_jobs(jobs, out, TWO, told)
    assert (ran.done, ran.failed) == (5, 1)
    bad = told.results()["bad"]
    assert (bad.state, bad.signal, bad.attempts) == ("failed", "SIGSEGV", 2)
    assert "ended its process (SIGSEGV)" in bad.reason
    assert "fatal.py" in bad.reason
    assert read_result(out, "bad") == bad
    assert told.starts() == {"bad": 2, **{f"good-{number}": 1 for number in range(5)}}


@pytest.mark.slow
def test_a_job_that_ends_a_worker_of_dask_is_named_with_its_signal(asymmetric_environment, tmp_path):
    jobs = [
        job(f"good-{number}", asymmetric_environment, sampling={"samples": 4, "seed": number}) for number in range(2)
    ]
    jobs.insert(0, job("bad", asymmetric_environment, {"folder": tmp_path, "habit": "segfault"}))
    told, out = Told(), tmp_path / "out"
    ran = run_jobs(jobs, out, DASK, told)
    assert (ran.done, ran.failed) == (2, 1)
    bad = told.results()["bad"]
    assert (bad.state, bad.signal) == ("failed", "SIGSEGV")
    assert any(note.startswith("Dask's dashboard: http") for note in told.notes())


@pytest.mark.slow
def test_a_job_that_ends_the_process_of_a_serial_batch_ends_only_itself_at_the_next_run(tmp_path):
    out = tmp_path / "out"
    jobs = [job("good-0", None), job("bad", None, {"folder": tmp_path, "habit": "exit"}), job("good-1", None)]
    first = Coordinator(jobs, out, SERIAL)
    first.until("Finished")
    assert first.process.wait(60) == 7
    first.close()
    told = Told()
    ran = run_jobs(jobs, out, SERIAL, told)
    assert (ran.done, ran.failed) == (2, 1)
    bad = told.results()["bad"]
    assert (bad.exit_code, bad.signal, bad.attempts) == (7, None, 2)
    assert "ended its process (exit code 7)" in bad.reason


@pytest.mark.slow
def test_a_full_disk_of_one_worker_costs_no_job(asymmetric_environment, tmp_path):
    full = {"folder": tmp_path, "habit": "full disk", "mark": str(tmp_path / "full")}
    jobs = [
        job(f"job-{number}", asymmetric_environment, full, sampling={"samples": 4, "seed": number})
        for number in range(5)
    ]
    told = Told()
    ran = run_jobs(jobs, tmp_path / "out", TWO, told)
    assert (ran.done, ran.failed) == (5, 0)
    assert sum("it will run once more" in note for note in told.notes()) == 2
    assert any("gets no more jobs" in note for note in told.notes())


@pytest.mark.slow
def test_large_bakes_are_shared_by_workers_and_have_the_bytes_of_one(asymmetric_environment, tmp_path):
    large = job("a", asymmetric_environment, views={"subdivision": 1})
    told = Told()
    assert run_jobs([large], tmp_path / "two", TWO, told).done == 1
    parts = [event for event in told.events if isinstance(event, Started)]
    assert Counter(one.part for one in parts) == {"prepare": 1, "12 views": 3, "6 views": 1, "finish": 1}
    assert run_jobs([large], tmp_path / "one", SERIAL).done == 1
    assert digests(tmp_path / "two") == digests(tmp_path / "one")


@pytest.mark.slow
def test_a_lost_scheduler_is_one_clear_line_and_costs_nothing_whole(four, undisturbed, tmp_path):
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    address = tmp_path / "scheduler.json"
    scheduler = subprocess.Popen(
        [*dask, "scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(address)],
        **quiet,
    )
    worker = subprocess.Popen(
        [*dask, "worker", "--scheduler-file", str(address), "--nthreads", "1", "--no-dashboard", "--no-nanny"], **quiet
    )
    try:
        import json

        deadline = time.monotonic() + 60
        while not address.exists():
            assert time.monotonic() < deadline
            time.sleep(0.1)
        run = RunConfig(executor="dask", scheduler=json.loads(address.read_text())["address"])
        told = Told(Finished, scheduler.kill)
        with pytest.raises(MachineError, match=r"the Dask scheduler was lost\. Start it again"):
            run_jobs(four, tmp_path / "out", run, told)
    finally:
        for process in (worker, scheduler):
            process.kill()
            process.wait(30)
    whole = list((tmp_path / "out" / "results").rglob("*.json"))
    assert whole
    before = {path: path.stat().st_mtime_ns for path in whole}
    assert run_jobs(four, tmp_path / "out", TWO).done == 4
    assert {path: path.stat().st_mtime_ns for path in whole} == before
    assert digests(tmp_path / "out") == undisturbed

"""A unit of work: pure, repeated without harm, and never raising for a job that fails."""

from __future__ import annotations

import json
import shutil

import drjit as dr
import pytest

from rsibr import backend
from rsibr.batches import worker
from rsibr.batches.result import JobResult, read_result, write_result
from rsibr.batches.tasks import Task
from rsibr.batches.worker import run_job, run_task
from rsibr.budget.promise import Promise
from rsibr.scene import python_plugins
from rsibr.store.bake import open_bake
from rsibr.store.directory import lock_directory
from tests.batches.jobs import digests, job


@pytest.fixture
def plugins(monkeypatch):
    """Forget plugins at the end."""
    monkeypatch.setattr(python_plugins, "_modules", {})
    monkeypatch.setattr(backend, "_registrations", list(backend._registrations))
    monkeypatch.setattr(backend, "_registered", dict(backend._registered))


@pytest.fixture(scope="module")
def baked(tmp_path_factory, asymmetric_environment):
    """Directory of a batch with one job."""
    out = tmp_path_factory.mktemp("baked")
    one = job("paint/a", asymmetric_environment, "solid-red")
    return one, run_job(one, out), out


def test_a_job_is_baked_and_its_result_is_on_the_disk(baked):
    one, found, out = baked
    made = open_bake(out / one.bake)
    assert (found.state, found.views, found.attempts) == ("done", 12, 1)
    assert found.noise == made.manifest.noise
    assert found.contents["material"] == made.manifest.identity["material"]["content"]
    assert found.bytes == sum(file.stat().st_size for file in made.path.rglob("*") if file.is_file())
    assert found.answers(one)
    assert read_result(out, one.name) == found
    assert len(list((out / "lights").iterdir())) == 1


@pytest.mark.parametrize("year", ["1970", "2999"])
def test_a_job_that_is_done_is_found_done_whatever_the_clock_of_its_machine_said(baked, tmp_path, year):
    """The clocks of two machines are never compared."""
    one, found, out = baked
    write_result(out, JobResult(**{**vars(found), "finished_at": f"{year}-01-01T00:00:00+00:00"}))
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.exr")}
    assert run_job(one, out).finished_at.startswith(year)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.exr")} == before


@pytest.mark.slow
def test_parts_of_a_bake_make_the_bytes_of_the_whole(baked, tmp_path):
    one, _, out = baked
    for task in (Task(one, "prepare"), Task(one, "views", (0, 11, 5)), Task(one, "views", tuple(range(12)))):
        done = run_task(task, tmp_path)
        assert done.result is None
        if task.step == "prepare":
            assert done.pending == tuple(range(12))
    found = run_task(Task(one, "finish", seconds=100.0), tmp_path).result
    assert found.seconds >= 100.0
    assert digests(tmp_path) == digests(out)


def test_threads_are_those_of_the_job_and_then_those_of_before(baked, tmp_path, monkeypatch):
    one, _, out = baked
    seen, before = [], dr.thread_count()
    step = worker._STEPS["whole"]
    monkeypatch.setitem(worker._STEPS, "whole", lambda *given: seen.append(dr.thread_count()) or step(*given))
    run_job(one, out, threads=before + 1)
    assert (seen, dr.thread_count()) == ([before + 1], before)


def test_a_bake_that_another_process_writes_is_waited_for(baked, monkeypatch):
    one, _, out = baked
    (out / one.bake / "manifest.json").write_text("{")
    lock = lock_directory(out / one.bake)
    monkeypatch.setattr(worker.time, "sleep", lambda _: lock.release() or shutil.rmtree(out / one.bake))
    assert run_job(one, out).state == "done"


def test_a_bake_that_another_process_does_not_end_is_a_reason(tmp_path, monkeypatch):
    one = job("a", None)
    (tmp_path / one.bake).mkdir()
    monkeypatch.setattr(worker, "LONGEST_WAIT", 0.0)
    with lock_directory(tmp_path / one.bake):
        found = run_job(one, tmp_path)
    assert (found.state, found.exit_code) == ("failed", 2)
    assert "another bake is writing into this directory" in found.reason


@pytest.mark.slow
def test_a_lost_mount_of_the_lights_is_a_reason_and_then_repaired(asymmetric_environment, tmp_path):
    one = job("a", asymmetric_environment)
    (tmp_path / "lights").write_text("no folder")
    found = run_job(one, tmp_path)
    assert (found.state, found.exit_code) == ("failed", 2)
    assert str(tmp_path / "lights") in found.reason
    (tmp_path / "lights").unlink()
    assert run_job(one, tmp_path).state == "done"
    shutil.rmtree(tmp_path / "lights")  # gone again: the next step that needs it has it made anew
    again = job("a", asymmetric_environment, then={"validate": {"views": 1, "samples": 16, "methods": ["nearest"]}})
    done = run_job(again, tmp_path)
    assert (done.state, done.error, done.then) == ("done", None, {"validate": {"report": "reports/a/report.html"}})
    assert (tmp_path / done.then["validate"]["report"]).is_file()


def test_a_missing_sky_is_a_reason(tmp_path):
    one = job("a", None)
    gone = {**one.settings, "environment": {**one.settings["environment"], "file": str(tmp_path / "gone.exr")}}
    gone["environment"].pop("emitter")
    found = run_job(type(one)("a", {}, gone), tmp_path)
    assert (found.state, found.exit_code) == ("failed", 2)
    assert "gone.exr" in found.reason
    assert "\n" not in found.reason


@pytest.mark.parametrize(("habit", "says"), [("raise", "KeyError: 'no such thing'"), ("sys.exit", "called sys.exit")])
def test_whatever_a_plugin_raises_is_a_reason(tmp_path, plugins, habit, says):
    one = job("a", None, {"folder": tmp_path, "habit": habit})
    found = run_job(one, tmp_path)
    assert (found.state, found.exit_code) == ("failed", 70)
    assert says in found.reason
    assert "\n" not in found.reason
    if habit == "raise":
        assert "fatal.py" in (tmp_path / "results" / "a.traceback.txt").read_text()


@pytest.mark.slow
def test_a_step_that_fails_fails_the_job_and_keeps_the_bake(baked, tmp_path):
    one, _, _ = baked
    asked = job(one.name, one.settings["environment"]["file"], "solid-red", then={"publish": ("nonsense",)})
    found = run_job(asked, tmp_path)
    assert (found.state, found.exit_code) == ("failed", 2)
    assert "unknown format 'nonsense'" in found.reason
    assert open_bake(tmp_path / one.bake).complete


@pytest.mark.slow
def test_a_bake_is_validated_and_published(baked, tmp_path):
    one, _, _ = baked
    steps = {"validate": {"views": 2, "samples": 16, "methods": ["rsibr", "nearest"], "lobes": False}}
    asked = job(one.name, one.settings["environment"]["file"], "solid-red", then={**steps, "publish": ("latlong-exr",)})
    found = run_job(asked, tmp_path)
    assert found.state == "done"
    told = json.loads((tmp_path / found.then["validate"]["report"]).with_name("metrics.json").read_text())
    assert found.error == max(view["methods"]["rsibr"]["rel_mse"]["value"] for view in told["views"])
    files = found.then["publish"]["latlong-exr"]
    assert len(files) == 12
    assert all((tmp_path / file).is_file() for file in files)
    assert (tmp_path / found.then["validate"]["report"]).is_file()


def test_a_broken_promise_is_a_reason(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "promises_of", lambda _: [Promise("budget.error", 0.01, 0.02)])
    found = run_job(job("a", None), tmp_path)
    assert (found.state, found.exit_code) == ("failed", 1)
    assert found.reason == "baked, with a broken promise: budget.error: promised 0.01, reached 0.02"

"""A batch from its file to its index: jobs run, resume and fail, and the forecast holds."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from rsibr.batches.batch import batch as run_batch
from rsibr.batches.events import Finished
from rsibr.batches.index import rows_of
from rsibr.resources import scenes
from tests.batches.files import BASE, write_folder

RSIBR = str(Path(sys.executable).with_name("rsibr"))
BATCH = """
name = "{material}-{sampling.time_budget_s}"
base = "base.toml"
[matrix]
material = ["matte-lambert", {bsdf = {type = "diffuse"}, name = "grey"}]
[[include]]
material = "matte-lambert"
"sampling.time_budget_s" = 0.001     # too little, which only a bake can tell
"""
CONFIG = """
environment = {emitter = {type = "constant", radiance = 0.5}}
material = {preset = "matte-lambert"}
map = {resolution = 8}
sampling = {samples = 16}
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A batch of three jobs, one of which fails, in `batch.toml` and `out`, its report and the events."""
    folder, events = tmp_path_factory.mktemp("ran"), []
    (folder / "base.toml").write_text(CONFIG)
    (folder / "batch.toml").write_text(BATCH)
    report = run_batch(folder / "batch.toml", out=folder / "out", executor="serial", on_event=events.append)
    return folder / "out", report, events


def test_a_job_that_fails_does_not_stop_the_others(ran):
    out, report, events = ran
    document = report.document
    assert (document.state, document.jobs, document.done, document.already_done) == ("failed", 3, 2, 0)
    (failed,) = report.failed
    assert failed.name == "matte-lambert-0.001"
    assert "0.001 s are too few" in failed.reason
    assert failed.exit_code == 2
    assert [event.result.state for event in events if isinstance(event, Finished)] == ["done", "done", "failed"]
    for name in ("matte-lambert-none", "grey-none"):
        assert (out / f"{name}.rsibr" / "manifest.json").is_file()


def test_a_command_repeats_the_failed_job_alone(ran):
    out, report, _ = ran
    words = shlex.split(report.failed[0].command)
    assert words == ["rsibr", "batch", str(out.parent / "batch.toml"), "--out", str(out), *words[5:]]
    assert words[5:] == ["--only", "name=matte-lambert-0.001"]
    again = run_batch(words[2], out=words[4], only=words[6:], executor="serial")
    assert (again.document.jobs, [failed.name for failed in again.failed]) == (1, ["matte-lambert-0.001"])


def test_the_overview_shows_all_jobs(ran):
    out, report, _ = ran
    rows = {row["name"]: row for row in rows_of(out / "index.sqlite")}
    assert {name: row["state"] for name, row in rows.items()} == {
        "matte-lambert-none": "done",
        "grey-none": "done",
        "matte-lambert-0.001": "failed",
    }
    assert rows["grey-none"]["material"] == "grey"
    assert rows["grey-none"]["bytes"] > 0
    assert report.document.bytes == sum(row["bytes"] for row in rows.values())
    assert "0.001 s are too few" in (out / "gallery.html").read_text()


def test_what_is_done_stays_as_it_is(ran):
    out, _, _ = ran
    files = [path for path in out.rglob("*.rsibr/**/*") if path.is_file()]
    before = {path: path.stat().st_mtime_ns for path in files}
    again = run_batch(out.parent / "batch.toml", out=out, executor="serial", only=["name=*-none"]).document
    assert (again.state, again.jobs, again.already_done, again.forecast) == ("done", 2, 2, None)
    assert {path: path.stat().st_mtime_ns for path in files} == before


@pytest.fixture
def file(tmp_path):
    write_folder(tmp_path)
    axes = 'material = [{file = "materials/*.xml"}]\nenvironment = ["skies/*.exr"]\n'
    (tmp_path / "base.toml").write_text(
        '[environment]\nemitter = {type = "constant"}\n[material]\npreset = "matte-lambert"\n'
        '[map]\nresolution = 16\n[sampling]\nsamples = 16\n[effects]\nview_dependence = "on"\n'
    )
    (tmp_path / "batch.toml").write_text(f'base = "base.toml"\n[matrix]\n{axes}')
    return tmp_path / "batch.toml"


def ended(*words) -> subprocess.CompletedProcess[str]:
    return subprocess.run([RSIBR, "batch", *map(str, words)], capture_output=True, check=False, text=True)


def maps(out: Path) -> dict[str, bytes]:
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("view_*.exr"))}


@pytest.mark.slow
def test_all_executors_and_shards_give_the_same_maps(file, tmp_path):
    found = {}
    for executor in ("serial", "processes", "dask"):
        done = ended(file, "--executor", executor, "--out", tmp_path / executor)
        assert done.returncode == 0, done.stderr
        found[executor] = maps(tmp_path / executor)
    for number in (1, 2):
        done = ended(file, "--executor", "serial", "--shard", f"{number}/2", "--out", tmp_path / "shards", "--json")
        assert done.returncode == 0, done.stderr
        document = json.loads(done.stdout)
        assert (document["jobs"], document["done"], document["index"]) == (2, 2, [])
    found["shards"] = maps(tmp_path / "shards")
    assert len(found["serial"]) == 4 * 12
    assert all(one == found["serial"] for one in found.values())
    assert json.loads(ended(file, "--reindex", "--out", tmp_path / "shards", "--json").stdout)["done"] == 4


TWO_BY_TWO = """
base = {{material = {{preset = "solid-red"}}, environment = {{emitter = {{type = "constant"}}}}}}
[matrix]
material = ["solid-red", "metallic-blue"]
environment = ["{skies}/city.exr", "{skies}/studio.exr"]
"map.resolution" = [32]
"sampling.samples" = [16]
[run]
executor = "serial"
"""


@pytest.mark.slow
def test_a_forecast_holds(tmp_path):
    """Bytes and files by the dry run's probes; processor time is in tests/benchmarks/test_dry_run.py, as all times are.

    Times are no matter of a test: here it is only ruled out that they are of another order.
    """
    file, out = tmp_path / "batch.toml", tmp_path / "out"
    file.write_text(TWO_BY_TWO.format(skies=scenes() / "environments"))
    told = json.loads(ended(file, "--dry-run", "--out", out, "--json").stdout)["forecast"]
    before = sum(os.times()[2:4])
    assert ended(file, "--out", out).returncode == 0
    taken = sum(os.times()[2:4]) - before
    written = [path for path in out.rglob("*") if path.is_file() and path.parent != out]
    assert (told["source"], told["jobs"], told["materials"], told["skies"]) == ("probes", 4, 2, 2)
    assert told["bytes"] == pytest.approx(sum(path.stat().st_size for path in written), rel=0.1)
    assert told["files"] == len(written)
    assert taken / 4 < told["processor_seconds"] < 4 * taken


@pytest.mark.slow
def test_a_material_that_ends_its_process_ends_its_probe_alone(tmp_path):
    """Its trial passes, because it is only evaluated there; the other kinds are probed."""
    (tmp_path / "crash.py").write_text(CRASH)
    tables = {
        "base": {**BASE, "plugins": {"modules": [str(tmp_path / "crash.py")]}},
        "matrix": {"material": ["matte-lambert", {"bsdf": {"type": "crash-in-kernel"}}]},
        "run": {"executor": "serial"},
    }
    found = run_batch(tables, out=tmp_path / "out", dry_run=True).document.forecast
    assert found.notes[0].startswith("crash-in-kernel: ended its process (SIG")
    assert [kind.material for kind in found.kinds] == ["matte-lambert", "crash-in-kernel"]


CRASH = """
import os, signal
import drjit as dr
import mitsuba as mi

class Crash(mi.BSDF):
    def __init__(self, props):
        super().__init__(props)
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]
    def sample(self, ctx, si, sample1, sample2, active=True):
        if dr.width(si) > 1000:
            os.kill(os.getpid(), signal.SIGSEGV)
        bs = mi.BSDFSample3f()
        bs.wo = mi.warp.square_to_cosine_hemisphere(sample2)
        bs.pdf = mi.warp.square_to_cosine_hemisphere_pdf(bs.wo)
        bs.eta = 1.0
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        bs.sampled_component = mi.UInt32(0)
        return bs, mi.Color3f(0.5)
    def eval(self, ctx, si, wo, active=True):
        return mi.Color3f(0.5) * dr.inv_pi * dr.maximum(wo.z, 0)
    def pdf(self, ctx, si, wo, active=True):
        return dr.maximum(wo.z, 0) * dr.inv_pi

mi.register_bsdf("crash-in-kernel", Crash)
"""

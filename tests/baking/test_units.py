"""Units of work: whatever process bakes a view, when, how often, killed or not, the maps are those of a plain bake."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import rsibr
from rsibr.baking import units
from rsibr.baking.baker import bake
from rsibr.baking.units import bake_unit, finish, prepare
from rsibr.errors import BakeError
from rsibr.store.atomic import write_atomic
from rsibr.store.bake import open_bake
from rsibr.store.manifest import read_manifest
from rsibr.store.writer import BakeWriter
from tests.store.synthetic import content
from tests.store.test_manifest import forge

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "glossy-plastic"
[map]
resolution = 16
[sampling]
samples = 64
seed = 7
"""

UNIT = "import sys; from rsibr.baking.units import bake_unit; bake_unit(sys.argv[1], [int(n) for n in sys.argv[2:]])"


@pytest.fixture(scope="module")
def config(tmp_path_factory, asymmetric_environment):
    path = tmp_path_factory.mktemp("units") / "small.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


@pytest.fixture(scope="module")
def plain(config):
    """Files of a bake in one piece."""
    return content(bake(config, out=config.parent / "plain.rsibr").path)


@pytest.fixture(autouse=True)
def _nothing_prepared(monkeypatch):
    """Let the first unit of a test prepare the scene by itself, as in a process of its own."""
    monkeypatch.setattr(units, "_latest", {})


def timeless(files: dict[str, bytes]) -> dict[str, object]:
    """Files of a bake, its manifest without times: what any way to bake must reproduce."""

    def without(value: object) -> object:
        if isinstance(value, dict):
            return {key: without(item) for key, item in value.items() if "seconds" not in key and key != "checksum"}
        return [without(item) for item in value] if isinstance(value, list) else value

    return files | {"manifest.json": without(json.loads(files["manifest.json"]))}


def test_units_in_any_order_and_twice_make_the_plain_bake(config, plain, tmp_path, monkeypatch):
    prepared = prepare(config, tmp_path / "b.rsibr")
    assert prepared.pending == tuple(range(12))
    with pytest.raises(BakeError, match="0 of 12 views"):
        finish(prepared.path)
    for chunk in ([11, 3], [3, 4, 11], [10, 9, 8, 7, 6, 5], [2, 0, 1], [5]):
        bake_unit(prepared.path, chunk)
        monkeypatch.setattr(units, "_latest", {})
    with pytest.raises(BakeError, match="is not finished: it holds 12 of 12 views"):
        open_bake(prepared.path)
    files = content(finish(prepared.path).path)
    assert timeless(files) == timeless(plain)
    assert content(finish(prepared.path).path) == files  # finished twice
    assert prepare(config, tmp_path / "b.rsibr").pending == ()


def test_a_unit_writes_nothing_but_its_maps_and_their_sidecars(config, plain, tmp_path):
    path = prepare(config, tmp_path / "b.rsibr").path
    before = content(path)
    bake_unit(path, [2, 5])
    added = {name: data for name, data in content(path).items() if name not in before}
    assert set(added) == {f"maps/view_000{k}.{suffix}" for k in (2, 5) for suffix in ("exr", "json")}
    assert before.items() <= content(path).items()
    assert all(added[name] == plain[name] for name in added if name.endswith("exr"))


def test_what_has_a_whole_sidecar_is_not_baked_again(config, plain, tmp_path, monkeypatch):
    """Not by another unit, not by a coordinator that comes after one that was lost, not by `rsibr bake`."""
    path = prepare(config, tmp_path / "b.rsibr").path
    bake_unit(path, range(6))
    stored = {file: file.stat().st_mtime_ns for file in sorted((path / "maps").glob("*.exr"))}
    seen = []
    bake_unit(path, range(6), on_progress=seen.append)
    assert not seen
    assert prepare(config, path).pending == tuple(range(6, 12))  # the manifest listed none of them
    assert not list((path / "maps").glob("*.json"))
    assert timeless(content(bake(config, out=path).path)) == timeless(plain)
    assert {file: file.stat().st_mtime_ns for file in stored} == stored


@pytest.mark.parametrize("damage", ["map", "no map", "sidecar", "another view", "another bake"])
def test_what_is_not_whole_is_baked_again(config, plain, tmp_path, damage):
    path = prepare(config, tmp_path / "b.rsibr").path
    bake_unit(path, [0, 1])
    exr, sidecar = (path / "maps" / f"view_0001.{suffix}" for suffix in ("exr", "json"))
    if damage == "map":
        exr.write_bytes(exr.read_bytes()[:-1])
    elif damage == "no map":
        exr.unlink()
    elif damage == "sidecar":
        sidecar.write_bytes(sidecar.read_bytes()[:-9])
    elif damage == "another view":
        sidecar.write_bytes((path / "maps" / "view_0000.json").read_bytes())
    else:
        forge(sidecar, lambda body: body.update(bits="0" * 64))
    assert prepare(config, path).pending == tuple(range(1, 12))
    bake_unit(path, range(12))
    assert timeless(content(finish(path).path)) == timeless(plain)


def test_files_that_a_new_coordinator_sweeps_are_written_again(config, tmp_path, monkeypatch):
    """One that takes a running unit for a killed one removes its temporary file, and a map without its sidecar."""
    path = prepare(config, tmp_path / "b.rsibr").path
    planned, swept = read_manifest(path / "manifest.json"), []

    def sweeping(file: Path, data: bytes) -> None:
        write_atomic(file, data)
        if file.suffix == ".exr" and not swept:
            with BakeWriter.open(path, planned) as writer:
                swept.append(writer.pending)
            assert not file.exists()

    monkeypatch.setattr("rsibr.store.sidecar.write_atomic", sweeping)
    bake_unit(path, [4])
    assert swept == [list(range(12))]
    assert 4 not in prepare(config, path).pending

    real, once = os.replace, iter([True])

    def without_temporary(source, target):
        if next(once, False):
            os.unlink(source)
        real(source, target)

    monkeypatch.setattr(os, "replace", without_temporary)
    write_atomic(tmp_path / "file", b"whole")
    assert (tmp_path / "file").read_bytes() == b"whole"


def test_a_unit_elsewhere_that_would_get_other_bits_is_refused(config, tmp_path, monkeypatch, gradient_sky):
    """Another content under the same name, other code, another processor: one line that says which."""
    sky = tmp_path / "sky.exr"
    text = config.read_text()
    own = tmp_path / "own.toml"
    own.write_text(text.replace(text.split('file = "')[1].split('"')[0], str(sky)))
    sky.write_bytes(Path(text.split('file = "')[1].split('"')[0]).read_bytes())
    path = prepare(own, tmp_path / "b.rsibr").path
    before = content(path)
    monkeypatch.setattr(units, "_latest", {})
    with monkeypatch.context() as patch:
        patch.setattr("rsibr.baking.planned_manifest.baking_code", lambda: "f" * 64)
        with pytest.raises(BakeError, match=r"cannot be continued here.*code of rsibr: \w{12} → f{12}") as refused:
            bake_unit(path, [0])
        assert "\n" not in str(refused.value)
    sky.write_bytes(gradient_sky.read_bytes())
    with pytest.raises(BakeError, match=r"environment\.content"):
        bake_unit(path, [0])
    assert content(path) == before


def test_a_unit_of_nothing_prepared_is_one_clear_line(tmp_path):
    for work in (lambda: bake_unit(tmp_path / "x.rsibr", [0]), lambda: finish(tmp_path / "x.rsibr")):
        with pytest.raises(BakeError, match=r"manifest\.json: cannot be read"):
            work()
    assert not (tmp_path / "x.rsibr").exists()


def test_a_view_that_does_not_exist(config, tmp_path):
    path = prepare(config, tmp_path / "b.rsibr").path
    for index in (-1, 12):
        with pytest.raises(IndexError):
            bake_unit(path, [0, index])
    assert not list((path / "maps").iterdir())


@pytest.mark.slow
def test_units_of_killed_processes_make_the_plain_bake(config, tmp_path, rng):
    """Two processes at once on overlapping views, killed at random moments with the coordinator's bookkeeping lost."""
    heavier = ["sampling.samples=1024", "map.resolution=64"]
    plain = content(bake(config, out=tmp_path / "plain.rsibr", overrides=heavier).path)
    path, kills = prepare(config, tmp_path / "b.rsibr", overrides=heavier).path, 0
    environment = os.environ | {"PYTHONPATH": str(Path(rsibr.__file__).parents[1])}
    while pending := prepare(config, path, overrides=heavier).pending:
        orders = (pending, pending[::-1])
        workers = [
            subprocess.Popen([sys.executable, "-c", UNIT, str(path), *map(str, views)], env=environment)
            for views in orders
        ]
        time.sleep(rng.uniform(2.0, 5.0))
        for worker in workers:
            os.kill(worker.pid, signal.SIGKILL)
            kills += worker.wait() == -signal.SIGKILL
    assert kills >= 2
    assert timeless(content(finish(path).path)) == timeless(plain)


def test_bytes_written_over_a_bake_of_many_views_are_few(config, tmp_path, monkeypatch):
    """Of manifests and sidecars at most 10 × the final manifest, however long the views take; by the clock, four."""
    written: dict[str, int] = {}

    def counting(file: Path, data: bytes) -> None:
        written[file.suffix] = written.get(file.suffix, 0) + len(data)
        write_atomic(file, data)

    for room in ("manifest", "sidecar"):
        monkeypatch.setattr(f"rsibr.store.{room}.write_atomic", counting)
    monkeypatch.setattr("rsibr.store.writer.MANIFEST_SECONDS", 0.0)  # as if each view took a second
    monkeypatch.setattr(os, "fsync", lambda _: None)
    sizes = ["views.subdivision=2", "map.resolution=8", "sampling.samples=8"]
    baked = bake(config, out=tmp_path / "b.rsibr", overrides=sizes)
    assert baked.view_count == 162
    size = (baked.path / "manifest.json").stat().st_size
    assert written[".exr"] == sum(state.bytes for state in baked.manifest.views)
    assert written[".json"] < 10 * size
    assert read_manifest(baked.path / "manifest.json") == baked.manifest

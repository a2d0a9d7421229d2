"""Whole bakes of small maps: reproducible to the bit, resumable after being killed, refused where they clash."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rsibr
from rsibr.baking.baker import bake
from rsibr.errors import BakeError
from rsibr.scene.config import Config
from rsibr.scene.material import load_material
from rsibr.store.bake import open_bake

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


@pytest.fixture
def config(tmp_path, asymmetric_environment):
    path = tmp_path / "small.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


def map_bytes(path):
    return {file.name: file.read_bytes() for file in sorted((path / "maps").iterdir())}


def test_same_config_same_bits_and_another_seed_others(config, tmp_path):
    one = bake(config, out=tmp_path / "one.rsibr")
    two = bake(config, out=tmp_path / "two.rsibr")
    other = bake(config, out=tmp_path / "other.rsibr", overrides=["sampling.seed=8"])
    assert len(map_bytes(one.path)) == 12
    assert map_bytes(one.path) == map_bytes(two.path)
    assert not set(map_bytes(one.path).values()) & set(map_bytes(other.path).values())


def test_views_are_independent_of_one_another(config, tmp_path):
    """A view is a pure function of config, view and seed: baked first or last, its bits are the same."""
    whole = bake(config, out=tmp_path / "whole.rsibr")
    kept = map_bytes(whole.path)
    for index in (0, 5, 11):
        (whole.path / "maps" / f"view_{index:04d}.exr").unlink()
    assert map_bytes(bake(config, out=whole.path).path) == kept


def test_second_run_bakes_nothing(config, tmp_path):
    first = bake(config, out=tmp_path / "b.rsibr")
    seen = []
    again = bake(config, out=tmp_path / "b.rsibr", on_progress=seen.append)
    assert not seen
    assert again.seconds == first.seconds


def test_progress_reaches_the_end_and_never_goes_back(config, tmp_path):
    seen = []
    bake(config, out=tmp_path / "b.rsibr", on_progress=seen.append)
    done = [progress.done for progress in seen]
    assert done == sorted(done)
    assert done[-1] == 12
    assert {progress.total for progress in seen} == {12}
    assert list(dict.fromkeys(progress.step for progress in seen)) == [*(f"view {n}" for n in range(1, 13)), "done"]


def test_changed_config_is_refused_with_the_difference(config, tmp_path):
    bake(config, out=tmp_path / "b.rsibr")
    with pytest.raises(BakeError, match=r"sampling\.samples: 64 → 128"):
        bake(config, out=tmp_path / "b.rsibr", overrides=["sampling.samples=128"])
    assert open_bake(tmp_path / "b.rsibr").config["sampling"]["samples"] == 64
    anew = bake(config, out=tmp_path / "b.rsibr", overrides=["sampling.samples=128"], fresh=True)
    assert anew.config["sampling"]["samples"] == 128


def test_changed_environment_file_is_refused(config, tmp_path, gradient_sky, asymmetric_environment):
    copy = tmp_path / "sky.exr"
    copy.write_bytes(asymmetric_environment.read_bytes())
    bake(config, out=tmp_path / "b.rsibr", overrides=[f"environment.file={copy}"])
    copy.write_bytes(gradient_sky.read_bytes())
    with pytest.raises(BakeError, match="environment"):
        bake(config, out=tmp_path / "b.rsibr", overrides=[f"environment.file={copy}"])


def test_config_comes_back_from_the_manifest_as_it_went_in(config, tmp_path):
    """The order of nested plugins too: it says which of two BSDFs a blend takes first."""
    blend = '{type="blendbsdf", weight=0.3, z={type="diffuse"}, a={type="roughconductor", alpha=0.2}}'
    out = bake(config, out=tmp_path / "b.rsibr", overrides=[f"material.bsdf={blend}"]).path
    read = Config.model_validate(open_bake(out).config)
    assert list(read.material.bsdf) == ["type", "weight", "z", "a"]
    assert load_material(read.material).digest == open_bake(out).manifest.identity["material"]["content"]


def test_manifest_tells_what_made_the_bake(config, tmp_path):
    manifest = bake(config, out=tmp_path / "b.rsibr").manifest
    assert manifest.config["sampling"] == {"samples": 64, "seed": 7, "adaptive": True}
    assert manifest.packages["rsibr"] == rsibr.__version__
    assert set(manifest.packages) == {"mitsuba", "drjit", "numpy", "OpenEXR", "rsibr"}
    assert manifest.material.name == "glossy-plastic"
    assert all(state.done and state.seconds > 0 for state in manifest.views)


def test_maps_explain_themselves(config, tmp_path):
    baked = bake(config, out=tmp_path / "b.rsibr")
    stored = baked.map(3)
    assert np.allclose(stored.view, baked.directions[3], atol=1e-6)
    assert np.allclose(stored.frame[:, 2], stored.view, atol=1e-6)
    assert stored.variance.min() >= 0
    assert (stored.variance[stored.coverage == 1] > 0).any()


def start(config, out):
    command = [sys.executable, "-c", "from rsibr.cli.app import main; main()", "bake", str(config), "--out", str(out)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)


@pytest.mark.slow
def test_killed_at_random_moments_it_ends_bit_identical(config, tmp_path, rng):
    """Kill -9 at several moments, views half written among them, then to the end: the bits of an unkilled bake."""
    heavier = ["--set", "sampling.samples=1024", "--set", "map.resolution=64"]
    whole = bake(config, out=tmp_path / "whole.rsibr", overrides=heavier[1::2])
    out, kills = tmp_path / "killed.rsibr", 0
    while kills < 6:
        command = [
            sys.executable,
            "-c",
            "from rsibr.cli.app import main; main()",
            "bake",
            str(config),
            "--out",
            str(out),
        ]
        process = subprocess.Popen([*command, *heavier], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(rng.uniform(0.5, 3.0))
        if process.poll() is not None:
            break
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        kills += 1
    assert kills >= 2
    resumed = bake(config, out=out, overrides=heavier[1::2])
    assert map_bytes(resumed.path) == map_bytes(whole.path)


@pytest.mark.slow
def test_two_bakes_into_one_directory_the_second_is_refused(config, tmp_path):
    out = tmp_path / "b.rsibr"
    first = subprocess.Popen(
        [sys.executable, "-c", "from rsibr.cli.app import main; main()", "bake", str(config), "--out", str(out),
         "--set", "map.resolution=128", "--set", "sampling.samples=8192"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        while not (out / "manifest.json").exists():
            assert first.poll() is None
            time.sleep(0.05)
        second = start(config, out)
        _, said = second.communicate(timeout=120)
        assert second.returncode == 2
        assert b"another" in said
        assert b"Traceback" not in said
    finally:
        first.kill()
        first.wait()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux says what memory a process took")
def test_memory_stays_below_two_gibibytes_and_does_not_grow_with_views_or_passes(config, tmp_path):
    """The issue's bake, 12 maps of 256² with 256 samples; then 4× the samples, and 42 views."""
    script = """
import sys
from pathlib import Path
from rsibr.cli.app import main
try:
    main()
finally:  # not getrusage: that remembers the memory of the process that started this one
    status = Path("/proc/self/status").read_text()
    print(int(status.split("VmHWM:")[1].split()[0]) * 1024, file=sys.stderr)
"""

    def peak(name, *overrides):
        sets = [part for override in overrides for part in ("--set", override)]
        command = [sys.executable, "-c", script, "bake", str(config), "--out", str(tmp_path / name), *sets]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return json.loads(done.stderr.strip().splitlines()[-1])

    small = peak("a.rsibr", "map.resolution=256", "sampling.samples=256")
    assert small < 2 * 2**30
    assert peak("b.rsibr", "map.resolution=128", "sampling.samples=4096") < small + 200 * 2**20
    assert peak("c.rsibr", "map.resolution=128", "sampling.samples=64", "views.subdivision=1") < small

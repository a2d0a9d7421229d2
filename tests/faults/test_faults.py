"""Kills, clocks and rivals: nothing is lost that the manifest says is there, nothing half-written taken for whole."""

from __future__ import annotations

import itertools
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.errors import RsibrError
from rsibr.store.bake import open_bake
from tests.cli.command import CONFIG, write_config
from tests.cli.test_processes import SLOW_CONFIG, start
from tests.store import synthetic
from tests.store.synthetic import MANY, content, write


def maps_of(path):
    return {name: data for name, data in content(path).items() if name != "manifest.json"}


@pytest.mark.slow
def test_writers_killed_at_a_hundred_random_moments_lose_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _: None)  # what goes on here syncs nothing: its process is not killed
    bakes = 80
    command = [sys.executable, synthetic.__file__, "moments", str(tmp_path), str(bakes)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert json.loads(done.stdout)["killed"] >= 100
    whole = content(tmp_path / "timed")
    for index in range(bakes):
        path = tmp_path / str(index)
        check_what_can_be_opened(path, whole)
        write(path, count=MANY)  # finished or not: it sweeps up what was left behind, too
        assert content(path) == whole


def check_what_can_be_opened(path, whole):
    try:
        found = open_bake(path)
    except RsibrError:
        return
    assert found.complete
    assert maps_of(path).items() >= {name: data for name, data in whole.items() if name != "manifest.json"}.items()


@pytest.mark.slow
def test_a_real_bake_killed_again_and_again_ends_bit_identical(tmp_path):
    config, out = write_config(tmp_path, SLOW_CONFIG), tmp_path / "x.rsibr"
    bake(config, out=tmp_path / "whole.rsibr")
    rng = np.random.default_rng(9)
    views = 0
    while views < 12:
        with start("bake", config, "--out", out) as process:
            deadline = time.monotonic() + 60
            while process.poll() is None and len(list(out.glob("maps/view_*.exr"))) <= views:
                assert time.monotonic() < deadline
                time.sleep(0.002)
            time.sleep(rng.uniform(0.0, 0.1))
            process.send_signal(signal.SIGKILL)
        for file in json.loads((out / "manifest.json").read_text())["views"]:
            if file["done"]:
                assert (out / file["file"]).read_bytes() == (tmp_path / "whole.rsibr" / file["file"]).read_bytes()
        views = len(list(out.glob("maps/view_*.exr")))
    bake(config, out=out)
    assert maps_of(out) == maps_of(tmp_path / "whole.rsibr")


@pytest.mark.parametrize("clock", ["perf_counter", "time", "monotonic"])
def test_a_clock_that_jumps_back_costs_nothing(tmp_path, monkeypatch, clock):
    config = write_config(tmp_path, CONFIG)
    bake(config, out=tmp_path / "steady.rsibr")
    ticks = itertools.count(1e9, -3600.0)
    monkeypatch.setattr(time, clock, lambda: next(ticks))
    jumped = bake(config, out=tmp_path / "jumped.rsibr")
    monkeypatch.undo()
    assert jumped.seconds >= 0.0
    assert all(view.seconds >= 0.0 for view in jumped.manifest.views)
    assert maps_of(tmp_path / "jumped.rsibr") == maps_of(tmp_path / "steady.rsibr")


@pytest.mark.slow
def test_of_two_processes_on_one_bake_one_is_refused(tmp_path):
    config, out = write_config(tmp_path, SLOW_CONFIG), tmp_path / "x.rsibr"
    both = [start("bake", config, "--out", out, "--json") for _ in range(2)]
    said = [process.communicate(timeout=120) for process in both]
    codes = sorted(process.returncode for process in both)
    # Where the first has ended before the second begins, that finds everything done.
    assert codes in ([0, 2], [0, 0]), said
    if codes == [0, 2]:
        refused = next(out for (out, _), process in zip(said, both, strict=True) if process.returncode == 2)
        assert "another bake is writing" in json.loads(refused)["error"]["what"]
    bake(config, out=tmp_path / "alone.rsibr")
    assert maps_of(out) == maps_of(tmp_path / "alone.rsibr")

"""Writers that are killed, and two at once: the next one goes on, and ends with the bytes of one never killed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rsibr.errors import BakeError, RsibrError
from rsibr.store.bake import BakeWriter, open_bake
from tests.store import synthetic
from tests.store.synthetic import COUNT, MANY, baked, content, manifest, write


@pytest.fixture(autouse=True)
def _no_sync(monkeypatch):
    """Writers of this process only go on where killed ones stopped: syncing to the disk would only take time."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


def script(*arguments: object) -> list[str]:
    return [sys.executable, synthetic.__file__, *map(str, arguments)]


def kill(*arguments: object) -> dict[str, int]:
    """Run the script that kills its writers, and return what it says of them."""
    done = subprocess.run(script(*arguments), capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_killed_before_any_change_to_the_disk_it_ends_as_if_never_killed(tmp_path):
    write(tmp_path / "whole")
    whole = content(tmp_path / "whole")
    steps = kill("steps", tmp_path, 200)["steps"]
    assert steps > 24  # the manifest, then two files a view; synced, renamed and synced again, each
    assert content(tmp_path / str(steps)) == whole
    halfway = 0
    for step in range(1, steps):
        path = tmp_path / str(step)
        check_what_can_be_opened(path)
        halfway += 0 < len(write(path)) < COUNT
        assert content(path) == whole, f"killed before change {step}"
    assert halfway > 8  # the views that were done stayed done


def test_killed_while_it_replaces_a_bake_it_is_the_old_one_or_the_new(tmp_path):
    write(tmp_path / "whole")
    write(tmp_path / "old", count=5, samples=128)
    whole, old = content(tmp_path / "whole"), content(tmp_path / "old")
    steps = kill("steps", tmp_path, 200)["steps"]
    assert steps > 29  # five maps to remove besides
    assert content(tmp_path / str(steps)) == whole
    replaced = 0
    for step in range(1, steps):
        path = tmp_path / str(step)
        if content(path)["manifest.json"] == old["manifest.json"]:
            assert open_bake(path).view_count == 5
        else:
            check_what_can_be_opened(path)
            write(path)
            assert content(path) == whole, f"killed before change {step}"
            replaced += 1
    assert 24 < replaced < steps - 1


def check_what_can_be_opened(path: Path) -> None:
    """Where a killed bake opens at all, it is whole."""
    try:
        bake = open_bake(path)
    except RsibrError:
        return
    for index in range(COUNT):
        np.testing.assert_array_equal(bake.map(index).layers["radiance"], baked(COUNT, index).layers["radiance"])


def test_killed_at_random_moments_it_ends_as_if_never_killed(tmp_path):
    bakes = 6
    killed = kill("moments", tmp_path, bakes)["killed"]
    assert killed > bakes  # of three writers of each bake, on average
    whole = content(tmp_path / "timed")
    assert open_bake(tmp_path / "timed").view_count == MANY
    for bake in range(bakes):
        write(tmp_path / str(bake), count=MANY)
        assert content(tmp_path / str(bake)) == whole


def test_a_second_writer_is_refused_until_the_first_is_killed(tmp_path):
    with subprocess.Popen(script("hold", tmp_path), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        try:
            assert holder.stdout.readline() == "held\n"
            before = content(tmp_path)
            for fresh in (False, True):
                with pytest.raises(BakeError, match="another bake is writing"):
                    write(tmp_path, fresh=fresh)
            assert content(tmp_path) == before
        finally:
            holder.kill()
    assert write(tmp_path) == [0, 1, 2, 3]


def test_a_second_writer_in_the_same_process_is_refused(tmp_path):
    with BakeWriter.open(tmp_path, manifest()):
        for _ in range(2):
            with pytest.raises(BakeError, match="another bake is writing"):
                BakeWriter.open(tmp_path, manifest())
    assert write(tmp_path) == [0, 1, 2, 3]


def test_a_refused_writer_gives_the_lock_free(tmp_path):
    write(tmp_path, samples=128)
    with pytest.raises(BakeError, match=r"sampling\.samples") as refused:
        write(tmp_path)
    assert write(tmp_path, samples=128) == []
    assert refused.tb is not None  # kept until here, and the writer's frames with it: no collector gave the lock free

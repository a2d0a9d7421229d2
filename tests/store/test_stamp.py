"""A large bake that was checked opens without hashing; whatever changes since is hashed, and found."""

from __future__ import annotations

import os
import shutil
import time

import pytest

from rsibr.errors import BakeError
from rsibr.store import stamp
from rsibr.store.bake import open_bake
from rsibr.validation.health.check import check
from tests.store.synthetic import baked, content, write
from tests.store.test_manifest import forge

VIEWS = 12
FILE = "maps/view_0003.exr"


@pytest.fixture
def large(tmp_path, monkeypatch):
    """A bake that counts as large, opened once."""
    monkeypatch.setattr(stamp, "LEAST_FILES", VIEWS)
    path = tmp_path / "x.rsibr"
    write(path, VIEWS)
    time.sleep(3 * stamp._TICK)
    open_bake(path)
    return path


@pytest.fixture
def hashed(monkeypatch):
    """Files that are hashed, by name."""
    names = []
    monkeypatch.setattr(
        "rsibr.store.integrity.file_checksum", lambda file, real=_real(): names.append(file.name) or real(file)
    )
    return names


def _real():
    from rsibr.store.atomic import file_checksum

    return file_checksum


def test_what_was_hashed_is_not_hashed_again(large, hashed):
    assert (large / stamp.STAMP_NAME).is_file()
    opened = open_bake(large)
    assert not hashed
    assert opened.map(3).layers["radiance"].tolist() == baked(VIEWS, 3).layers["radiance"].tolist()
    open_bake(large, rehash=True)
    assert len(hashed) == VIEWS


def test_a_small_bake_is_hashed_and_gets_no_stamp(tmp_path, hashed):
    write(tmp_path, VIEWS)
    for _ in range(2):
        open_bake(tmp_path)
    assert len(hashed) == 2 * VIEWS
    assert stamp.STAMP_NAME not in content(tmp_path)


@pytest.mark.parametrize("how", ["written", "replaced", "times restored", "exchanged", "manifest"])
def test_every_change_is_found_on_opening(large, how):
    """Also one that keeps size and time of modification: no program sets the time of change."""
    file, other = large / FILE, large / "maps" / "view_0004.exr"
    data, times = file.read_bytes(), file.stat()
    flipped = bytes([*data[:-1], data[-1] ^ 1])
    if how == "manifest":
        forge(large / "manifest.json", lambda body: body["views"][3].update(sha256="0" * 64))
    elif how == "exchanged":
        shutil.move(file, large / "aside")
        shutil.move(other, file)
        shutil.move(large / "aside", other)
    elif how == "replaced":
        (large / "new").write_bytes(flipped)
        os.replace(large / "new", file)
    else:
        file.write_bytes(flipped)
    if how == "times restored":
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    with pytest.raises(BakeError, match=r"view_000[34]\.exr: is truncated or altered"):
        open_bake(large)


def test_damage_behind_the_stamps_back_is_found_by_check_and_on_reading(large):
    """As by a failing disk, which changes no time: here the stamp is made to fit."""
    (large / FILE).write_bytes((large / FILE).read_bytes()[:-1] + b"x")
    time.sleep(3 * stamp._TICK)
    from rsibr.store.manifest import read_manifest

    forged = stamp.file_state(large, read_manifest(large / "manifest.json"))
    (large / stamp.STAMP_NAME).write_text(f"{forged}\n")
    opened = open_bake(large)
    for found in (lambda: opened.map(3), lambda: open_bake(large, rehash=True), lambda: check(large)):
        with pytest.raises(BakeError, match=r"view_0003\.exr: is truncated or altered"):
            found()


@pytest.mark.parametrize("kind", ["link", "map is a link", "maps are a link", "pipe", "garbage"])
def test_a_stamp_of_a_stranger_opens_nothing_and_overwrites_nothing(large, tmp_path, kind):
    place, mine = large / stamp.STAMP_NAME, tmp_path / "mine"
    mine.write_text("three years of work")
    if "map" in kind:
        target = large / "maps" if kind == "maps are a link" else large / FILE
        target.rename(tmp_path / "outside")
        target.symlink_to(tmp_path / "outside")
        with pytest.raises(BakeError, match="is a link"):
            open_bake(large)
        return
    place.unlink()
    if kind == "link":
        place.symlink_to(mine)
    elif kind == "pipe":
        os.mkfifo(place)
    else:
        place.write_bytes(b"\xff" * 65)
    assert open_bake(large).view_count == VIEWS
    assert mine.read_text() == "three years of work"


def test_a_file_changed_within_the_tick_of_the_clock_is_not_trusted(large):
    (large / FILE).write_bytes((large / FILE).read_bytes())
    from rsibr.store.manifest import read_manifest

    assert stamp.file_state(large, read_manifest(large / "manifest.json")) is None

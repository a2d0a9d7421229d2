"""The store: nothing that is not whole is ever taken for whole, and nothing of anyone else's is touched."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from rsibr.errors import BakeError, MachineError
from rsibr.store.bake import BakeWriter, open_bake
from rsibr.store.directory import remove_folder
from rsibr.store.map_file import MapFile
from tests.store.synthetic import COUNT, RESOLUTION, SECONDS, baked, content, directions, manifest, viewpoints, write

# --- Whole bakes ------------------------------------------------------------------------------------------------------


def test_a_bake_holds_what_was_committed(tmp_path):
    path = tmp_path / "deep" / "paint.rsibr"
    assert write(path) == [0, 1, 2, 3]
    bake = open_bake(path)
    assert bake.complete
    assert (bake.view_count, bake.resolution, bake.seconds) == (COUNT, RESOLUTION, COUNT * SECONDS)
    assert bake.bytes == sum(file.stat().st_size for file in (path / "maps").iterdir())
    assert bake.config["sampling"]["samples"] == 64
    np.testing.assert_array_equal(bake.directions, directions(COUNT))
    np.testing.assert_array_equal(bake.triangles, viewpoints(COUNT).triangles)
    for index in range(COUNT):
        np.testing.assert_array_equal(bake.map(index).layers["radiance"], baked(COUNT, index).layers["radiance"])
    assert set(content(path)) == {"manifest.json", *(f"maps/view_000{i}.exr" for i in range(COUNT))}


def test_arrays_of_an_open_bake_cannot_be_written(tmp_path):
    write(tmp_path)
    for array in (open_bake(tmp_path).directions, open_bake(tmp_path).triangles):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("index", [-1, COUNT])
def test_a_view_that_does_not_exist(tmp_path, index):
    write(tmp_path)
    with pytest.raises(IndexError, match="of 4"):
        open_bake(tmp_path).map(index)


def test_an_unfinished_bake_says_how_far_it_is(tmp_path):
    write(tmp_path / "a", count=12, views=7)
    with pytest.raises(BakeError, match=r"7 of 12 views.*[Rr]un the same `rsibr bake` command again"):
        open_bake(tmp_path / "a")
    assert write(tmp_path / "a", count=12) == [7, 8, 9, 10, 11]
    assert open_bake(tmp_path / "a").complete


def test_what_is_no_bake_is_not_opened(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    for name, message in [("absent", "does not exist"), ("file", "is a file"), ("folder", "no bake"), ("x" * 999, "x")]:
        with pytest.raises(BakeError, match=message):
            open_bake(tmp_path / name)


# --- Damage -----------------------------------------------------------------------------------------------------------


def damages(data: bytes) -> Iterator[bytes]:
    random = np.random.default_rng(11)
    for length in [0, 1, len(data) - 1, *random.integers(0, len(data), 20)]:
        yield data[:length]
    for offset in [*range(8), *random.integers(0, len(data), 200)]:
        flipped = bytearray(data)
        flipped[offset] ^= 1 << int(random.integers(8))
        yield bytes(flipped)
    yield data + b"\0"


def test_every_damage_to_a_map_is_found_on_opening_and_mended_by_baking(tmp_path, capfd):
    write(tmp_path)
    whole = content(tmp_path)
    opened = open_bake(tmp_path)
    file = tmp_path / "maps" / "view_0001.exr"
    for damaged in damages(file.read_bytes()):
        file.write_bytes(damaged)
        with pytest.raises(BakeError, match=r"view_0001\.exr: is truncated or altered"):
            open_bake(tmp_path)
        with pytest.raises(BakeError, match=r"view_0001\.exr: is truncated or altered"):
            opened.map(1)
    assert capfd.readouterr() == ("", "")  # found before OpenEXR sees it
    assert write(tmp_path) == [1]
    assert content(tmp_path) == whole


def test_a_missing_map_is_found_on_opening_and_baked_again(tmp_path):
    write(tmp_path)
    whole = content(tmp_path)
    (tmp_path / "maps" / "view_0002.exr").unlink()
    with pytest.raises(BakeError, match=r"view_0002\.exr: is missing"):
        open_bake(tmp_path)
    assert write(tmp_path) == [2]
    assert content(tmp_path) == whole


def test_exchanged_maps_are_found(tmp_path):
    write(tmp_path)
    first, second = (tmp_path / "maps" / f"view_000{i}.exr" for i in range(2))
    data = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(data)
    with pytest.raises(BakeError, match=r"view_0000\.exr"):
        open_bake(tmp_path)


def test_a_broken_manifest_is_refused_unless_fresh(tmp_path):
    write(tmp_path)
    whole = content(tmp_path)
    (tmp_path / "manifest.json").write_bytes(whole["manifest.json"][:100])
    with pytest.raises(BakeError, match=r"manifest\.json.*--fresh"):
        open_bake(tmp_path)
    with pytest.raises(BakeError, match=r"manifest\.json.*--fresh"):
        write(tmp_path)
    assert write(tmp_path, fresh=True) == [0, 1, 2, 3]
    assert content(tmp_path) == whole


# --- Other configs, other directories ---------------------------------------------------------------------------------


def test_another_config_is_refused_with_the_difference(tmp_path):
    write(tmp_path)
    before = content(tmp_path)
    with pytest.raises(BakeError, match=r"sampling\.samples: 64 → 128.*--fresh") as raised:
        write(tmp_path, samples=128)
    assert "\n" not in str(raised.value)
    assert content(tmp_path) == before


def test_fresh_leaves_nothing_of_the_old_bake(tmp_path):
    write(tmp_path / "a", count=5)
    (tmp_path / "a" / "notes.txt").write_text("mine")
    (tmp_path / "a" / "maps" / "mine.exr").write_text("mine")
    assert write(tmp_path / "a", count=COUNT, samples=128, fresh=True) == [0, 1, 2, 3]
    write(tmp_path / "b", count=COUNT, samples=128)
    mine = {"notes.txt": b"mine", "maps/mine.exr": b"mine"}
    assert content(tmp_path / "a") == content(tmp_path / "b") | mine


def test_fresh_bakes_an_equal_bake_anew(tmp_path):
    write(tmp_path)
    whole = content(tmp_path)
    assert write(tmp_path, fresh=True) == [0, 1, 2, 3]
    assert content(tmp_path) == whole


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize("foreign", ["thesis.tex", "manifest.json", "maps/view_0000.exr", ".hidden"])
def test_a_foreign_directory_is_never_touched(tmp_path, foreign, fresh):
    (tmp_path / foreign).parent.mkdir(exist_ok=True)
    (tmp_path / foreign).write_text("three years of work")
    with pytest.raises(BakeError, match="no bake"):
        write(tmp_path, fresh=fresh)
    assert content(tmp_path) == {foreign: b"three years of work"}
    assert not (tmp_path / ".lock").exists()


def test_an_empty_directory_is_taken_and_a_file_is_not(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("mine")
    assert write(tmp_path / "empty") == [0, 1, 2, 3]
    for place in ("file", "file/inside"):
        with pytest.raises(BakeError, match="file"):
            write(tmp_path / place, fresh=True)
    assert (tmp_path / "file").read_text() == "mine"


# --- Programming errors -----------------------------------------------------------------------------------------------


def test_commit_refuses_what_is_not_the_view(tmp_path):
    without_variance = MapFile(**{**vars(baked(COUNT, 1)), "variance": None})
    with BakeWriter.open(tmp_path, manifest()) as writer:
        writer.commit(0, baked(COUNT, 0), SECONDS)
        for index, map_file, seconds, message in [
            (0, baked(COUNT, 0), SECONDS, "not pending"),
            (COUNT, baked(COUNT, 2), SECONDS, "not pending"),
            (1, baked(COUNT, 2), SECONDS, "seen from"),
            (1, baked(COUNT, 1, resolution=4), SECONDS, "texels"),
            (1, without_variance, SECONDS, "variance"),
            (1, baked(COUNT, 1), float("nan"), "nan s"),
        ]:
            with pytest.raises(ValueError, match=message):
                writer.commit(index, map_file, seconds)
        assert writer.pending == [1, 2, 3]
    assert set(content(tmp_path)) == {"manifest.json", "maps/view_0000.exr"}


# --- The machine fails ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("at", [1, 2])
def test_a_full_disk_costs_one_view_at_most(tmp_path, monkeypatch, call, at):
    """The first call is the map's, the second the folder's or the manifest's."""
    write(tmp_path / "whole")
    real, calls = getattr(os, call), iter(range(1, 100))

    def full(*arguments: Any) -> Any:
        if next(calls) == at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*arguments)

    with BakeWriter.open(tmp_path / "a", manifest()) as writer:
        writer.commit(0, baked(COUNT, 0), SECONDS)
        with monkeypatch.context() as patch:
            patch.setattr(os, call, full)
            with pytest.raises(MachineError, match=r"No space left.*[Ff]ree some space"):
                writer.commit(1, baked(COUNT, 1), SECONDS)
        assert writer.pending == [1, 2, 3]
    assert not [name for name in content(tmp_path / "a") if name.endswith("tmp")]
    assert write(tmp_path / "a") == [1, 2, 3]
    assert content(tmp_path / "a") == content(tmp_path / "whole")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_directory_is_said(tmp_path):
    (tmp_path / "a").mkdir(mode=0o500)
    with pytest.raises(BakeError, match="cannot be written"):
        write(tmp_path / "a")
    with pytest.raises(BakeError, match="cannot be written"):
        write(tmp_path / "a" / "deeper")


@pytest.mark.parametrize("call", ["mkdir", "open"])
def test_a_read_only_file_system_is_said(tmp_path, monkeypatch, call):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    with monkeypatch.context() as patch:
        patch.setattr(os, call, refuse)
        with pytest.raises(BakeError, match=r"cannot be written \(Read-only file system\)"):
            write(tmp_path / "a")
    assert write(tmp_path / "a") == [0, 1, 2, 3]


def test_a_removed_folder_leaves_nothing_and_follows_no_link(tmp_path):
    write(tmp_path / "a")
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").write_text("mine")
    (tmp_path / "a" / "link").symlink_to(tmp_path / "kept")
    (tmp_path / "a.removed").mkdir()  # of a process that was killed
    (tmp_path / "a.removed" / "half").write_text("")
    remove_folder(tmp_path / "a")
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    assert (tmp_path / "kept" / "file").read_text() == "mine"
    with pytest.raises(BakeError, match="cannot be written"):
        remove_folder(tmp_path / "a")

"""The one place that writes: regular files atomically, special files into, links followed, nothing else."""

from __future__ import annotations

import os
import select
import stat
import threading
from pathlib import Path

import pytest

from rsibr.errors import BakeError, MachineError
from rsibr.store.atomic import write_atomic
from rsibr.store.bake import open_bake
from rsibr.store.directory import make_own_folder
from tests.store.synthetic import content, write


def device(path: Path, minor: int) -> Path:
    """A device of one's own, 3 swallows all, 7 is full: those of the machine would be the victims of a failure."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, minor))
    except PermissionError:
        pytest.skip("only root makes devices")
    return path


def test_a_device_is_written_into_and_stays_one(tmp_path):
    null = device(tmp_path / "null", 3)
    write_atomic(null, b"data")
    (tmp_path / "link").symlink_to(null)
    write_atomic(tmp_path / "link", b"data")
    assert stat.S_ISCHR(null.lstat().st_mode)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["link", "null"]


def test_a_device_that_is_full_is_the_machines_lack(tmp_path):
    with pytest.raises(MachineError, match="No space left"):
        write_atomic(device(tmp_path / "full", 7), b"data")


def test_a_link_is_followed_and_stays_one(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "real").write_bytes(b"old")
    for target, wanted in (("folder/real", "folder/real"), ("folder/new", "folder/new")):
        link = tmp_path / "link"
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        write_atomic(link, b"data")
        assert link.is_symlink()
        assert (tmp_path / wanted).read_bytes() == b"data"
        assert not (tmp_path / wanted).is_symlink()


def test_a_pipe_is_written_into_if_someone_reads_it_and_never_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(BakeError, match="a pipe that no one reads"):
        write_atomic(pipe, b"data")
    descriptor = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    os.set_blocking(descriptor, True)
    data, heard = os.urandom(300_000), []  # more than a pipe holds

    def listen() -> None:
        select.select([descriptor], [], [], 10)  # before its first writer a pipe reads as ended
        with os.fdopen(descriptor, "rb") as file:
            heard.append(file.read())

    reader = threading.Thread(target=listen)
    reader.start()
    write_atomic(pipe, data)
    reader.join(10)
    assert heard == [data]
    assert stat.S_ISFIFO(pipe.lstat().st_mode)


@pytest.mark.parametrize("stream", ["/dev/stdout", "/dev/stderr", "/dev/fd/1", "/proc/self/fd/2", "link", "folder/1"])
def test_a_standard_stream_is_refused_by_any_name(tmp_path, stream):
    if not Path("/proc/self/fd").exists():
        pytest.skip("no /proc here")
    (tmp_path / "link").symlink_to("/dev/stdout")
    (tmp_path / "folder").symlink_to("/proc/self/fd")
    with pytest.raises(BakeError, match="is a standard stream"):
        write_atomic(tmp_path / stream, b"data")


def test_what_cannot_be_written_is_said(tmp_path):
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "dangling").symlink_to("gone/x")
    for name, says in (
        ("circle", "symbolic links"),
        ("dangling", "No such file"),
        (".", "directory"),
        ("x" * 256, "long"),
    ):
        with pytest.raises(BakeError, match=says):
            write_atomic(tmp_path / name, b"data")


def test_a_name_may_be_as_long_as_the_file_system_allows(tmp_path):
    for name in ("x" * 255, "é" * 127):
        write_atomic(tmp_path / name, b"data")
        assert (tmp_path / name).read_bytes() == b"data"


# --- Bakes ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fresh", [False, True])
def test_maps_behind_a_link_are_neither_read_nor_written_nor_deleted(tmp_path, fresh):
    write(tmp_path / "x.rsibr")
    (tmp_path / "x.rsibr" / "maps").rename(tmp_path / "elsewhere")
    (tmp_path / "x.rsibr" / "maps").symlink_to(tmp_path / "elsewhere")
    before = content(tmp_path / "elsewhere")
    with pytest.raises(BakeError, match=r"maps: is a link"):
        write(tmp_path / "x.rsibr", samples=128, fresh=fresh)
    assert content(tmp_path / "elsewhere") == before
    with pytest.raises(BakeError, match=r"view_0000\.exr: is a link"):
        open_bake(tmp_path / "x.rsibr")


@pytest.mark.parametrize("name", ["manifest.json", "maps/view_0001.exr", "light.exr", ".lock"])
def test_a_file_of_a_bake_that_is_a_link_is_not_written_through(tmp_path, name):
    write(tmp_path / "x.rsibr")
    mine = tmp_path / "mine"
    mine.write_text("three years of work")
    (tmp_path / "x.rsibr" / name).unlink(missing_ok=True)
    (tmp_path / "x.rsibr" / name).symlink_to(mine)
    with pytest.raises(BakeError, match="is a link, not a file of the bake"):
        write(tmp_path / "x.rsibr", samples=128, fresh=True)
    assert mine.read_text() == "three years of work"


def test_a_folder_in_which_files_are_deleted_is_no_link(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "pictures").symlink_to("elsewhere")
    with pytest.raises(BakeError, match="pictures: is a link"):
        make_own_folder(tmp_path / "pictures")
    make_own_folder(tmp_path / "own")
    assert (tmp_path / "own").is_dir()

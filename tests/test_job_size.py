"""A job is held against the free disk and memory before it starts."""

from __future__ import annotations

import json

import pytest

import rsibr
from rsibr import machine
from rsibr.errors import InputError
from rsibr.job_size import LARGE_BYTES, LARGE_MEMORY, LARGE_SECONDS, JobSize, in_bytes
from rsibr.machine import Memory
from rsibr.store.bake import open_bake
from tests.cli.command import CONFIG, Shell, write_config

COMMANDS = {
    "bake": ("bake", "{config}", "--out", "{out}"),
    "reconstruct": ("reconstruct", "{bake}", "--view", "1,2,3", "--out", "{out}"),
    "validate": ("validate", "{bake}", "--out", "{out}", "--views", "1", "--samples", "16", "--method", "nearest"),
}


@pytest.fixture
def scarce(monkeypatch):
    """Return a function that sets free disk space and memory [bytes]."""

    def set_free(disk=2**50, memory=2**50):
        monkeypatch.setattr(machine, "free_disk", lambda _: disk)
        monkeypatch.setattr(machine, "memory", lambda: Memory(2**50, memory))

    return set_free


@pytest.fixture
def shell(monkeypatch, capsys):
    return Shell(monkeypatch, capsys)


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("baked")
    return rsibr.bake(write_config(folder), out=folder / "small.rsibr").path


def test_a_job_may_take_all_that_is_free_and_no_byte_more(tmp_path, scarce):
    scarce(disk=1000, memory=2000)
    JobSize("bake", disk=1000, memory=2000).admit(tmp_path, allow_large=False)
    with pytest.raises(InputError, match=r"a bake takes about 1001 B on disk, and 1000 B are free at .*x\. Lower"):
        JobSize("bake", disk=1001, memory=2000).admit(tmp_path / "x", allow_large=False)
    with pytest.raises(InputError, match=r"about 1.95 KiB of memory, and 1.95 KiB are free"):
        JobSize("bake", disk=1000, memory=2001).admit(tmp_path, allow_large=False)
    JobSize("bake", disk=1001, memory=2001).admit(tmp_path, allow_large=True)
    JobSize("bake", disk=1001).admit(None, allow_large=False)  # writes nothing


def test_where_the_system_tells_no_memory_none_is_missed(tmp_path, scarce):
    scarce(memory=None)
    JobSize("bake", memory=2**60).admit(tmp_path, allow_large=False)


@pytest.mark.parametrize(
    "job",
    [JobSize("", disk=LARGE_BYTES), JobSize("", memory=LARGE_MEMORY), JobSize("", seconds=LARGE_SECONDS)],
)
def test_each_quantity_alone_makes_a_job_large(job):
    assert job.is_large
    assert not JobSize("", LARGE_BYTES - 1, LARGE_MEMORY - 1, LARGE_SECONDS * 0.99).is_large


@pytest.mark.parametrize(("count", "text"), [(0, "0 B"), (1023, "1023 B"), (1536, "1.5 KiB"), (3 * 2**40, "3 TiB")])
def test_bytes_have_a_unit(count, text):
    assert in_bytes(count) == text


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_asks_for_yes_and_leaves_nothing(command, shell, scarce, baked, tmp_path):
    names = {"config": write_config(tmp_path), "out": tmp_path / "out.exr", "bake": baked}
    arguments = [word.format(**names) for word in COMMANDS[command]]
    scarce(memory=1000)
    ended = shell.refuses(*arguments, "--json", says="--yes: a ")
    assert "of memory, and 1000 B are free" in ended.stderr
    assert not names["out"].exists()
    assert shell(*arguments, "--yes").code == 0


def test_a_bake_asks_for_the_disk_of_its_views_that_are_left(shell, scarce, tmp_path):
    config, out = write_config(tmp_path), tmp_path / "x.rsibr"
    scarce(disk=2**20)
    error = shell.refuses("bake", config, "--out", out, "--json", says="on disk, and 1 MiB are free").json["error"]
    assert (error["where"], error["exit_code"]) == ("--yes", 2)
    assert not out.exists()
    with pytest.raises(InputError, match=r"^allow_large: a bake of 12 views of 8² takes about"):
        rsibr.bake(config, out=out)
    assert rsibr.bake(config, out=out, allow_large=True).view_count == 12
    assert shell("bake", config, "--out", out).code == 0  # finished: nothing is left to write


def test_2048_and_ten_thousand_views_are_refused_in_one_line_before_any_of_them(shell, scarce, tmp_path):
    config = write_config(tmp_path, CONFIG.replace("resolution = 8", "resolution = 2048\n[views]\nsubdivision = 5"))
    scarce(disk=2**29)
    ended = shell.refuses("bake", config, "--out", tmp_path / "x.rsibr", says="10242 views of 2048²")
    assert "512 MiB are free" in ended.stderr


def test_a_large_bake_is_announced_before_its_first_view_and_a_small_one_is_not(shell, monkeypatch, tmp_path):
    config = write_config(tmp_path)
    assert "on disk" not in shell("bake", config, "--out", tmp_path / "small.rsibr").stderr
    monkeypatch.setattr("rsibr.job_size.LARGE_BYTES", 1)
    monkeypatch.setattr("rsibr.baking.job.TIMED_SAMPLES", 1)
    said = []
    rsibr.bake(config, out=tmp_path / "x.rsibr", on_forecast=said.append, on_progress=lambda _: said.append("view"))
    (job,) = [entry for entry in said if entry != "view"]
    assert said[0] is job
    assert job.seconds > 0
    stderr = shell("bake", config, "--out", tmp_path / "y.rsibr").stderr
    (line,) = [line for line in stderr.splitlines() if "on disk" in line]
    assert line.startswith("bake of 12 views of 8²: about ")
    assert "of memory" in line
    assert "s" in line.rpartition(",")[2]


def test_a_validation_forecasts_its_time_from_its_bake(baked):
    said = []
    opened = open_bake(baked)
    rsibr.validate(opened, views=2, samples=16, methods=["nearest"], on_forecast=said.append)
    (job,) = said
    assert job.name == "validation of 2 views of 8²"
    assert job.seconds == pytest.approx(opened.manifest.seconds / 12 * 2)
    assert json.dumps(job.memory)

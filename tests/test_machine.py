"""Limits of control groups bound the memory; disk space is that of the nearest existing folder."""

from __future__ import annotations

import os
import shutil

import pytest

from rsibr import machine


def write_group(folder, limit, used, version, cache=0):
    folder.mkdir(parents=True, exist_ok=True)
    names = {1: ("memory.limit_in_bytes", "memory.usage_in_bytes"), 2: ("memory.max", "memory.current")}[version]
    for name, value in zip(names, (limit, used), strict=True):
        (folder / name).write_text(f"{value}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{'total_' * (version == 1)}inactive_file {cache}\n")


@pytest.mark.parametrize(("version", "controllers"), [(1, "memory"), (2, "")])
def test_each_group_and_its_parents_set_a_limit(tmp_path, version, controllers):
    membership = tmp_path / "cgroup"
    membership.write_text(f"7:cpu:/other\n1:{controllers}:/job/step\n")
    top = tmp_path / "fs" / controllers
    write_group(top / "job" / "step", "max", 1, version)
    write_group(top / "job", 1000, 900, version, cache=300)
    write_group(top / "other", 10, 10, version)
    assert list(machine._group_limits(tmp_path / "fs", membership)) == [(1000, 600)]
    write_group(top, 800, 700, version)  # a container's own group, as it sees it
    assert sorted(machine._group_limits(tmp_path / "fs", membership)) == [(800, 700), (1000, 600)]


def test_the_smallest_limit_counts(monkeypatch):
    monkeypatch.setattr(machine, "_group_limits", lambda: iter([(2**20, 2**19), (2**62, 0), (2**19, 2**20)]))
    assert machine.memory() == machine.Memory(2**19, 0)


def test_no_group_is_no_limit(tmp_path):
    assert list(machine._group_limits(tmp_path, tmp_path / "absent")) == []


def test_the_disk_is_that_of_the_nearest_folder(tmp_path):
    assert machine.existing_folder(tmp_path / "a" / "b") == tmp_path
    assert abs(machine.free_disk(tmp_path / "a" / "b") - shutil.disk_usage(tmp_path).free) < 2**30


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity on this system")
def test_cores_are_those_that_the_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3})
    assert machine.usable_cores() == 1

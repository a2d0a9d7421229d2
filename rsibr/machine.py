"""What this machine offers a job: processor cores, memory and disk space, within the limits of a container."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rsibr.errors import InputError

_CGROUPS = Path("/sys/fs/cgroup")
_INACTIVE = "total_inactive_file", "inactive_file"
"""Keys of a group's file cache in `memory.stat`, versions 1 and 2: the kernel gives it back on demand."""


@dataclass(frozen=True)
class Memory:
    """Memory of the machine, or the smaller limit of a container [bytes].

    Attributes
    ----------
    total : int
        Physical memory, or the limit.
    available : int or None
        Memory that a process can take without swapping; None where the system does not tell.
    """

    total: int
    available: int | None


def usable_cores() -> int:
    """Processor cores that this process may run on."""
    with suppress(AttributeError):  # macOS has no affinity
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory() -> Memory:
    """Memory of the machine, within the limits of the control groups (version 1 or 2) that hold this process."""
    total, available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), None
    info = Path("/proc/meminfo")
    if info.is_file():
        kib = {key: int(rest.split()[0]) for key, rest in (line.split(":") for line in info.read_text().splitlines())}
        available = kib["MemAvailable"] * 1024
        for limit, used in _group_limits():
            total, available = min(total, limit), min(available, max(0, limit - used))
    return Memory(total, available)


def free_disk(path: Path) -> int:
    """Bytes that this user may write to the file system of `path`, or of its nearest existing parent."""
    return shutil.disk_usage(existing_folder(path)).free


def existing_folder(path: Path) -> Path:
    """Return `path`, or its nearest parent that exists."""
    return next(place for place in (path, *path.absolute().parents) if place.exists())


def make_folder(folder: Path) -> None:
    """Make a folder for output, and its parents, unless it exists.

    Raises
    ------
    InputError
        If it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = f"{folder} cannot be made ({error.strerror})"
        raise InputError(what, where="out", fix="choose another place") from error


def _group_limits(root: Path = _CGROUPS, membership: Path = Path("/proc/self/cgroup")) -> Iterator[tuple[int, int]]:
    """Yield memory limit and use of each control group that holds this process [bytes]."""
    for folder in _groups(root, membership):
        for limit_name, use_name in (
            ("memory.max", "memory.current"),
            ("memory.limit_in_bytes", "memory.usage_in_bytes"),
        ):
            with suppress(OSError, ValueError):  # not of this version, or "max": no limit
                limit = int((folder / limit_name).read_text())
                yield limit, int((folder / use_name).read_text()) - _reclaimable(folder)


def _groups(root: Path, membership: Path) -> Iterator[Path]:
    """Yield the folders of the memory groups of this process and of all their parents."""
    lines = membership.read_text().splitlines() if membership.is_file() else []
    for _, controllers, name in (line.split(":", 2) for line in lines):
        if controllers not in ("", "memory"):
            continue
        top = root / controllers
        yield top  # inside a container the group's own folder is often mounted here
        place = top / name.lstrip("/")
        yield from (folder for folder in (place, *place.parents) if top in folder.parents)


def _reclaimable(folder: Path) -> int:
    with suppress(OSError, ValueError):
        found = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return next((int(found[key]) for key in _INACTIVE if key in found), 0)
    return 0

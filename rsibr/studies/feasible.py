"""Refuse at once what a study cannot have: output that cannot be written, maps that fit nowhere."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from rsibr import machine
from rsibr.errors import InputError, MachineError
from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.methods.warp_blend.source_maps import fits_device_array
from rsibr.scene.views import load_viewpoints
from rsibr.store.directory import make_folder
from rsibr.studies.agenda import Agenda, BakeSize
from rsibr.studies.config import StudyConfig
from rsibr.validation.reference import MINIMUM_BUFFERS

_CHANNELS = 7
"""Channels of the smallest map: radiance, variance, coverage."""

_BYTES = 4

_COMPRESSED = 0.4
"""Size of a map file over that of its values, at the least: noise hardly compresses."""


def check_folders(folder: Path, parts: Sequence[str], files: Sequence[str]) -> None:
    """Make the folders of a study, and check that its files can be written when it ends.

    Parameters
    ----------
    folder : Path
        Directory of the study.
    parts, files : sequence of str
        Names of the folders in it, and of the files.

    Raises
    ------
    InputError
        If a folder may not be written to, or is a file; if a file is a folder.
    BakeError, MachineError
        If a folder cannot be made.
    """
    for part in parts:
        make_folder(folder / part)
        if not os.access(folder / part, os.W_OK | os.X_OK):
            raise InputError("is not writable", where=str(folder / part), fix="choose another --out")
    for file in files:
        if (folder / file).is_dir():
            raise InputError("is a folder, where the study writes a file", where=str(folder / file), fix="remove it")


def check_sizes(study: StudyConfig, agenda: Agenda, resolution: int, folder: Path) -> None:
    """Check that each bake fits into a device array and into memory, and all together onto the disk.

    All sizes are lower bounds, so that nothing is refused that could be done.

    Parameters
    ----------
    study : StudyConfig
    agenda : Agenda
        Bakes of each scene.
    resolution : int
        Texels a side of the judged pictures.
    folder : Path
        Directory of the study.

    Raises
    ------
    MachineError
        If a bake, or the references, cannot be held.
    """
    memory, disk = machine.memory().total, machine.free_disk(folder)
    for size in agenda:
        views = _views(study, size)
        named = f"{views} maps of {size.resolution}²"
        fix = "lower resolution or subdivision in the sweeps"
        if not fits_device_array(views, size.resolution):
            raise MachineError(f"{named} do not fit into one device array", where=study.name, fix=fix)
        _check(_map_bytes(views, size), memory, f"{named} take", "of memory", study.name, fix)
    truth = study.judge.views * MINIMUM_BUFFERS * resolution**2 * 3 * _BYTES
    fix = "lower judge.resolution or judge.views"
    _check(
        truth, memory, f"references of {study.judge.views} views of {resolution}² take", "of memory", study.name, fix
    )
    sizes = [_COMPRESSED * _map_bytes(_views(study, size), size) for size in agenda]
    bakes = len(study.scenes) * sum(sizes) if study.judge.keep_bakes else max(sizes)
    taken = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    fix = "free some space, or bake less in the sweeps"
    _check(bakes - taken, disk, "the bakes take", "on the disk", str(folder), fix)


def _check(needed: float, there: float, what: str, place: str, where: str, fix: str) -> None:
    if needed > there:
        message = f"{what} at least {needed / 2**30:.3g} GiB {place}, and there are {there / 2**30:.3g} GiB"
        raise MachineError(message, where=where, fix=fix)


def _views(study: StudyConfig, size: BakeSize) -> int:
    return len(load_viewpoints(study.base.views)) if size.subdivision is None else VIEW_COUNTS[size.subdivision]


def _map_bytes(views: int, size: BakeSize) -> float:
    return float(views * size.resolution**2 * _CHANNELS * _BYTES)

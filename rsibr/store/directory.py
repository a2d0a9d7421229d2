"""Directory of a bake: ownership, write lock, and integrity of its files."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from rsibr.errors import BakeError
from rsibr.regular_file import kind_of
from rsibr.store.atomic import is_leftover, sync_folder, unwritable
from rsibr.store.manifest import LIGHT_NAME, MANIFEST_NAME, MAPS_NAME

LOCK_NAME = ".lock"
MAP_PATTERN = re.compile(r"view_\d{4,}\.(?:exr|json)")
"""Name of a map or of its sidecar."""

BAKE_AGAIN = "run the same `rsibr bake` command again to finish it"

_ELSEWHERE = "choose another --out"


def claim_directory(path: Path) -> None:
    """Create the directory of a bake, or check that the existing one is a bake's. Other directories are not modified.

    Raises
    ------
    BakeError
        If `path` is a file, a directory with other content, or not writable; or if what it holds of a bake are links,
        through which a bake would write and delete elsewhere.
    """
    try:
        if path.exists() and not path.is_dir():
            raise BakeError("is a file; a bake is a directory", where=str(path), fix=_ELSEWHERE)
        make_folder(path)
        _check_own(path)
        names = {entry.name for entry in entries(path) if not is_leftover(entry)}
        # A writer creates lock, folder of maps, manifest, in this order, and may have been killed in between
        begun = names <= {LOCK_NAME, MAPS_NAME} and not any(entries(path / MAPS_NAME))
    except OSError as error:
        raise unwritable(path, error) from error
    if not (begun or {MANIFEST_NAME, MAPS_NAME} <= names):
        raise BakeError("is a directory with other things in it, and no bake", where=str(path), fix=_ELSEWHERE)


def lock_directory(path: Path) -> FileLock:
    """Acquire the exclusive write lock of the bake at `path`, without waiting.

    The system releases it when its holder ends, also by `kill -9`; the lock file remains.

    Raises
    ------
    BakeError
        If another writer holds it, or the directory is not writable.
    """
    lock = FileLock(path / LOCK_NAME, thread_local=False)
    try:
        lock.acquire(blocking=False)
    except Timeout as error:
        fix = f"wait until it ends, or {_ELSEWHERE}"
        raise BakeError("another bake is writing into this directory", where=str(path), fix=fix) from error
    except OSError as error:
        raise unwritable(path, error) from error
    return lock


def _check_own(path: Path) -> None:
    """Raise a BakeError if a file that a writer replaces or deletes is a link or no file, or `maps/` is a link."""
    _refuse_link(path / MAPS_NAME)
    maps = [entry for entry in entries(path / MAPS_NAME) if MAP_PATTERN.fullmatch(entry.name)]
    for place in (path / LOCK_NAME, path / MANIFEST_NAME, path / LIGHT_NAME, *maps):
        kind = kind_of(place.lstat().st_mode) if os.path.lexists(place) else None
        if kind is not None:
            raise BakeError(f"is {kind}, not a file of the bake", where=str(place), fix=_ELSEWHERE)


def make_own_folder(folder: Path) -> None:
    """Create a folder inside an output, such as `maps/` or `pictures/`, in which files are replaced and deleted.

    Raises
    ------
    MachineError, BakeError
        If it cannot be created; or if it is a link, through which files would be deleted elsewhere.
    """
    _refuse_link(folder)
    make_folder(folder)


def _refuse_link(folder: Path) -> None:
    if folder.is_symlink():
        what = "is a link: files in the folder that it names would be replaced and deleted"
        raise BakeError(what, where=str(folder), fix=f"put a folder in its place, or {_ELSEWHERE}")


def make_folder(folder: Path) -> None:
    """Create `folder` and its parents if absent, and sync the new directory entry.

    Raises
    ------
    MachineError, BakeError
        If it cannot be created.
    """
    try:
        if not folder.is_dir():
            folder.mkdir(parents=True, exist_ok=True)
            sync_folder(folder.parent)
    except OSError as error:
        raise unwritable(folder, error) from error


def remove_folder(folder: Path) -> None:
    """Delete a folder and all that is in it. One that is killed meanwhile leaves nothing under the folder's own name.

    Raises
    ------
    MachineError, BakeError
        If it cannot be deleted.
    """
    doomed = folder.with_name(f"{folder.name}.removed")
    try:
        shutil.rmtree(doomed, ignore_errors=True)  # of a process that was killed
        folder.replace(doomed)
        shutil.rmtree(doomed)
    except OSError as error:
        raise unwritable(folder, error) from error


def entries(folder: Path) -> Iterator[Path]:
    """Entries of `folder`, sorted by name; none if it does not exist."""
    if folder.is_dir():
        yield from sorted(folder.iterdir())

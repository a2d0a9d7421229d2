"""Directory of a bake: ownership, write lock, and integrity of its files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from rsibr.errors import BakeError
from rsibr.store.atomic import file_checksum, is_leftover, sync_folder, unreadable, unwritable
from rsibr.store.manifest import MANIFEST_NAME, MAPS_NAME, LightRecord, ViewState

LOCK_NAME = ".lock"
BAKE_AGAIN = "run the same `rsibr bake` command again to finish it"

_ELSEWHERE = "choose another --out"


def claim_directory(path: Path) -> None:
    """Create the directory of a bake, or check that the existing one is a bake's. Other directories are not modified.

    Raises
    ------
    BakeError
        If `path` is a file, a directory with other content, or not writable.
    """
    try:
        if path.exists() and not path.is_dir():
            raise BakeError("is a file; a bake is a directory", where=str(path), fix=_ELSEWHERE)
        make_folder(path)
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


def entries(folder: Path) -> Iterator[Path]:
    """Entries of `folder`, sorted by name; none if it does not exist."""
    if folder.is_dir():
        yield from sorted(folder.iterdir())


def check_file(file: Path, state: ViewState | LightRecord) -> None:
    """Check that `file` exists with the size and checksum recorded in the manifest.

    Raises
    ------
    BakeError
        If it is missing, cannot be read, or is truncated or altered.
    """
    try:
        size = file.stat().st_size
    except FileNotFoundError as error:
        raise BakeError("is missing", where=str(file), fix=BAKE_AGAIN) from error
    except OSError as error:
        raise unreadable(file, error) from error
    if size != state.bytes or file_checksum(file) != state.sha256:
        raise altered(file)


def is_whole(file: Path, state: ViewState | LightRecord) -> bool:
    """Whether `check_file` accepts `file`."""
    try:
        check_file(file, state)
    except BakeError:
        return False
    return True


def altered(file: Path) -> BakeError:
    """Return the error for a `file` that is not as the bake wrote it."""
    fix = "run the same `rsibr bake` command again to make it anew"
    return BakeError("is truncated or altered: it is not the file that the bake wrote", where=str(file), fix=fix)

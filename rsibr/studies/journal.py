"""Results of a study on disk: one small file each, written atomically."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from rsibr.errors import BakeError
from rsibr.regular_file import read_regular
from rsibr.store.atomic import checksum, is_leftover, unreadable, unwritable, write_atomic
from rsibr.store.directory import entries, make_folder, make_own_folder
from rsibr.store.manifest import canonical

LOCK_NAME = ".lock"


class Journal:
    """Results by a key of all that they depend on: content, seeds, versions. A change affects only dependent results.

    Parameters
    ----------
    folder : Path
        Where the files lie; made where missing.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        make_own_folder(folder)
        for leftover in filter(is_leftover, list(entries(folder))):  # of a process that was killed
            leftover.unlink(missing_ok=True)

    def find(self, key: Mapping[str, Any]) -> Any:
        """Return the result stored under `key`; None without one, or if its file was altered."""
        path = self._path(key)
        try:
            content = json.loads(read_regular(path))
            result, found = content["result"], content["checksum"]
        except FileNotFoundError:
            return None
        except OSError as error:
            raise unreadable(path, error) from error
        except (ValueError, LookupError, TypeError, RecursionError):
            return None
        return result if found == checksum(canonical(result)) else None

    def store(self, key: Mapping[str, Any], result: Any) -> None:
        """Store a result, plain JSON data, under `key`; it is synced to disk on return.

        Raises
        ------
        MachineError, BakeError
            If it cannot be written.
        """
        plain = json.loads(canonical(result))
        content = {"key": dict(key), "result": plain, "checksum": checksum(canonical(plain))}
        write_atomic(self._path(key), json.dumps(content, indent=1, ensure_ascii=False).encode())

    def _path(self, key: Mapping[str, Any]) -> Path:
        return self._folder / f"{name_of(key)}.json"


def name_of(key: Mapping[str, Any]) -> str:
    """File name for `key`, without extension: its kind and part of its hash."""
    return f"{key['kind']}-{checksum(canonical(key))[:20]}"


def lock_study(folder: Path) -> FileLock:
    """Make the directory of a study where it is missing, and take the one lock on writing into it, without waiting.

    Raises
    ------
    BakeError
        If another study holds it, or the directory may not be written to.
    """
    make_folder(folder)
    lock = FileLock(folder / LOCK_NAME, thread_local=False)
    try:
        lock.acquire(blocking=False)
    except Timeout as error:
        fix = "wait until it ends, or choose another --out"
        raise BakeError("another study is writing into this directory", where=str(folder), fix=fix) from error
    except OSError as error:
        raise unwritable(folder, error) from error
    return lock

"""Stamp of a checked bake: what was hashed once is not hashed again at every opening.

After a whole check of a large bake, a digest of its manifest and of name, size, times and inode of every file is kept
in the hidden file `.checked`. As long as the digest stays the same, opening trusts the files. A file that is written,
replaced, copied or restored gets another time of change, which no program can set, and the next opening hashes all
again. Whatever the stamp says, a map and a light are hashed when they are read, so that damage by the disk itself is
found at the latest then.
"""

from __future__ import annotations

import json
import os
import stat
import time
from contextlib import suppress
from pathlib import Path

from rsibr.errors import RsibrError
from rsibr.store.atomic import checksum, read_bytes, write_atomic
from rsibr.store.manifest import Manifest

STAMP_NAME = ".checked"

LEAST_FILES, LEAST_BYTES = 64, 2**26
"""Maps, or bytes of maps and light, from which a bake is stamped: smaller ones are hashed in less than 0.1 s."""

_TICK = 0.02
"""Longest step [s] of the clock that stamps files: a change within it may leave the times as they were."""


def file_state(bake: Path, manifest: Manifest) -> str | None:
    """Digest of the manifest and of the state of every file of a bake; None if a file is missing, or is none."""
    files = [*(state.file for state in manifest.views), *([manifest.light.file] if manifest.light else [])]
    rows: list[object] = [checksum(manifest.model_dump_json().encode())]
    newest = 0
    try:
        if stat.S_ISLNK((bake / manifest.views[0].file).parent.lstat().st_mode):
            return None
        for name in files:
            found = os.lstat(bake / name)
            if not stat.S_ISREG(found.st_mode):
                return None
            rows.append([name, found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino])
            newest = max(newest, found.st_mtime_ns, found.st_ctime_ns)
    except OSError:
        return None
    return checksum(json.dumps(rows).encode()) if abs(time.time_ns() - newest) > _TICK * 1e9 else None


def is_stamped(bake: Path, state: str | None) -> bool:
    """Whether a bake was checked as a whole, and no file has changed since; `state` from `file_state`."""
    with suppress(RsibrError, UnicodeDecodeError):
        place = bake / STAMP_NAME
        return state is not None and place.is_file() and read_bytes(place, most=100).decode() == f"{state}\n"
    return False


def stamp(bake: Path, manifest: Manifest, state: str | None) -> None:
    """Keep that a bake was checked as a whole, if it is large and may be written to.

    Parameters
    ----------
    bake : Path
        Directory of the bake.
    manifest : Manifest
        Its manifest.
    state : str or None
        From `file_state`, taken before the check.
    """
    is_large = len(manifest.views) >= LEAST_FILES or manifest.size >= LEAST_BYTES
    place = bake / STAMP_NAME
    if is_large and state is not None and state == file_state(bake, manifest) and not place.is_symlink():
        with suppress(RsibrError):
            write_atomic(place, f"{state}\n".encode())

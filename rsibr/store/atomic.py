"""Atomic file writes: temporary name, fsync, rename. A file is complete or absent."""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
from pathlib import Path

from rsibr.errors import BakeError, MachineError, RsibrError

_SUFFIX = ".rsibr-tmp"
_FULL_DISK = {errno.ENOSPC, errno.EDQUOT}
_MACHINE_ERRORS = {*_FULL_DISK, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE}


def write_atomic(path: Path, data: bytes) -> None:
    """Write `data` to `path` so that a crash at any moment leaves either the old file or the new one.

    The data is written to a hidden file in the same folder and synced; the file is renamed, and the folder synced, so
    that the rename survives a power failure.

    Parameters
    ----------
    path : Path
        File to write or to replace; its folder must exist.
    data : bytes
        Content of the file.

    Raises
    ------
    MachineError
        If the disk is full or fails.
    BakeError
        If the folder is missing or not writable.
    """
    if not path.name or path.is_dir():
        raise unwritable(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    # The random part separates processes that write the same file; the last rename wins
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}{_SUFFIX}")
    try:
        try:
            with temporary.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
            sync_folder(path.parent)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise unwritable(path, error) from error


def is_leftover(path: Path) -> bool:
    """Whether `path` is a temporary file of `write_atomic`, left by a killed process."""
    return path.name.startswith(".") and path.name.endswith(_SUFFIX)


def checksum(data: bytes) -> str:
    """SHA-256 of `data`, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def file_checksum(path: Path) -> str:
    """SHA-256 of the file at `path`, in hexadecimal, read in blocks.

    Raises
    ------
    BakeError
        If the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def read_bytes(path: Path) -> bytes:
    """Whole content of the file at `path`.

    Raises
    ------
    BakeError
        If the file cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error


def unreadable(path: Path, error: OSError) -> RsibrError:
    """Error of the project for a system error in reading `path`."""
    if error.errno in _MACHINE_ERRORS:
        return MachineError(f"cannot be read ({error.strerror})", where=str(path))
    return BakeError(f"cannot be read ({error.strerror})", where=str(path))


def unwritable(path: Path, error: OSError) -> RsibrError:
    """Error of the project for a system error in writing `path`: MachineError if disk or memory are at fault."""
    what = f"cannot be written ({error.strerror})"
    if error.errno in _FULL_DISK:
        return MachineError(what, where=str(path), fix="free some space, then run the same command again")
    if error.errno in _MACHINE_ERRORS:
        return MachineError(what, where=str(path))
    return BakeError(what, where=str(path), fix="choose a place that exists and that you may write to")


def sync_folder(folder: Path) -> None:
    """Sync the directory entries of `folder` to the disk; raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

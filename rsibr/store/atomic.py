"""The one place that writes files: a regular file is complete or as it was, a special file is written into."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import stat
from pathlib import Path

from rsibr.errors import BakeError, MachineError, RsibrError
from rsibr.regular_file import NotRegularError, kind_of, open_regular

_SUFFIX = ".rsibr-tmp"
_LONGEST_STEM = 200
"""Bytes of a file's name that its temporary name keeps: file systems end names at 255 bytes."""

_FULL_DISK = {errno.ENOSPC, errno.EDQUOT}
_MACHINE_ERRORS = {*_FULL_DISK, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE}

_STANDARD_STREAM = re.compile(r"/dev/std(in|out|err)|/proc/\d+(/task/\d+)?/fd/[012]")
_MOST_LINKS = 40
_ATTEMPTS = 3


def write_atomic(path: Path, data: bytes) -> None:
    """Write `data` to `path` so that a crash at any moment leaves either the old file or the new one.

    The data is written to a hidden file in the same folder and synced; the file is renamed, and the folder synced, so
    that the rename survives a power failure.

    Parameters
    ----------
    path : Path
        File to write or to replace; its folder must exist. A link is followed: the file that it names is replaced, not
        the link. A pipe with a reader and a character device, such as `/dev/null`, are written into.
    data : bytes
        Content of the file.

    Raises
    ------
    MachineError
        If the disk is full or fails.
    BakeError
        If the folder is missing or not writable; or if the path is a folder, a block device, a socket, a pipe without a
        reader, a standard stream, or a link in a circle.

    Notes
    -----
    A special file is never replaced: to root, a rename over `/dev/null` would succeed.
    """
    if not path.name:
        raise unwritable(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    try:
        mode = check_writable(path)
        if mode is None or stat.S_ISREG(mode):
            _replace(Path(os.path.realpath(path)), data)
        else:
            _write_into(path, data)
    except OSError as error:
        raise unwritable(path, error) from error


def check_writable(path: Path) -> int | None:
    """Check, without opening it, that `path` is a file of a kind that `write_atomic` writes.

    Returns
    -------
    int or None
        `st_mode` of the file that it names, links followed; None if there is none yet.

    Raises
    ------
    OSError
        If it is a folder, a block device, a socket, a standard stream, or a link in a circle.
    """
    for place in _links(path):
        if _STANDARD_STREAM.fullmatch(place):
            what = f"{place} is a standard stream, which the lines of a command go to"
            raise NotRegularError(errno.EINVAL, what, str(path))
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not (stat.S_ISREG(mode) or stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)):
        raise NotRegularError(errno.EINVAL, f"it is {kind_of(mode)}, not a file", str(path))
    return mode


def _links(path: Path) -> list[str]:
    """The path, and each path that it names through a link; of all of them the folder is resolved."""
    place, found = path, list[str]()
    while len(found) <= _MOST_LINKS:
        place = Path(os.path.realpath(place.parent)) / place.name
        found.append(str(place))
        if not place.is_symlink():
            break
        place = place.parent / place.readlink()
    return found


def _replace(path: Path, data: bytes) -> None:
    """Replace a file; again if a writer that began meanwhile has swept the temporary one, as a killed process's."""
    for left in reversed(range(_ATTEMPTS)):
        try:
            _replace_once(path, data)
            break
        except FileNotFoundError:
            if not left or not path.parent.is_dir():
                raise


def _replace_once(path: Path, data: bytes) -> None:
    # The random part separates processes that write the same file; the last rename wins
    stem = os.fsdecode(os.fsencode(path.name)[:_LONGEST_STEM])
    temporary = path.with_name(f".{stem}.{secrets.token_hex(4)}{_SUFFIX}")
    try:
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
        sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def _write_into(path: Path, data: bytes) -> None:
    """Write into an existing pipe or character device; OSError if no one reads the pipe."""
    try:
        # O_NONBLOCK: the opening of a pipe does not wait for a reader
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise OSError(errno.ENXIO, "it is a pipe that no one reads", str(path)) from error
    os.set_blocking(descriptor, True)  # a reader may be slower than this
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)


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
        If it is no regular file, or cannot be read.
    """
    try:
        with open_regular(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def read_bytes(path: Path, most: int | None = None) -> bytes:
    """Whole content of the file at `path`.

    Parameters
    ----------
    path : Path
        A regular file, or a link to one.
    most : int, optional
        Largest size [bytes].

    Raises
    ------
    BakeError
        If it is no regular file, is larger than `most`, or cannot be read.
    """
    try:
        with open_regular(path) as file:
            data = file.read() if most is None else file.read(most + 1)
    except OSError as error:
        raise unreadable(path, error) from error
    if most is not None and len(data) > most:
        raise BakeError(f"is larger than {most / 2**20:.0f} MiB", where=str(path))
    return data


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

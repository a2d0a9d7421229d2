"""Reading of files that a user or a stranger names: regular files only, so that a read neither waits nor ends never."""

from __future__ import annotations

import errno
import io
import os
import stat
from pathlib import Path

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a link",
}


class NotRegularError(OSError):
    """The path exists, but is no regular file: a pipe or a device may never end, and its content changes."""


def open_regular(path: Path) -> io.BufferedReader:
    """Open a regular file for reading; links are followed.

    Parameters
    ----------
    path : Path
        Any path.

    Returns
    -------
    binary file
        Open for reading.

    Raises
    ------
    NotRegularError
        If it is a pipe, a device, a socket or a folder; its `strerror` says which. It is not opened, so that no device
        is set off and no writer of a pipe is waited for.
    OSError
        If it does not exist or may not be read.
    """
    _check(path.stat().st_mode, path)
    # Another file may have taken its place since: without O_NONBLOCK the opening of a pipe would wait
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _check(os.fstat(descriptor).st_mode, path)
    except NotRegularError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path) -> bytes:
    """Whole content of a regular file; raises like `open_regular`."""
    with open_regular(path) as file:
        return file.read()


def kind_of(mode: int) -> str | None:
    """Name of the kind of file with this `st_mode`, such as "a named pipe"; None for a regular file."""
    return _KINDS.get(stat.S_IFMT(mode))


def _check(mode: int, path: Path) -> None:
    kind = kind_of(mode)
    if kind is not None:
        number = errno.EISDIR if stat.S_ISDIR(mode) else errno.EINVAL
        raise NotRegularError(number, f"it is {kind}, not a file", str(path))


def is_file(path: Path) -> bool:
    """Whether a path names a file; a name that the system cannot hold, such as one too long, names none."""
    try:
        return path.is_file()
    except OSError:
        return False

"""Opening of OpenEXR files whose content is not trusted: what the library prints about them is not shown."""

from __future__ import annotations

import contextlib
import io
import os
import threading
from collections.abc import Iterator
from typing import Any, BinaryIO

import OpenEXR

_ONE_AT_A_TIME = threading.Lock()
"""The standard streams are the process's; two threads that exchanged them at once would leave one of them lost."""


@contextlib.contextmanager
def open_exr(source: BinaryIO, *, header_only: bool = False) -> Iterator[Any]:
    """Open an OpenEXR file; a defect in it is told by an exception alone.

    Parameters
    ----------
    source : binary file
        The file, at its beginning.
    header_only : bool
        Whether to leave out the pixels, which a header may say are more than the memory holds.

    Yields
    ------
    OpenEXR.File
        Closing it empties its headers.
    """
    # The library prints warnings on stdout, which `--json` reserves for its object, and defects on descriptor 2
    with (
        _ONE_AT_A_TIME,
        contextlib.redirect_stdout(io.StringIO()),
        _silent_descriptor(2),
        OpenEXR.File(source, header_only=header_only) as file,
    ):
        yield file


@contextlib.contextmanager
def _silent_descriptor(descriptor: int) -> Iterator[None]:
    """Send what C code writes to a descriptor nowhere."""
    try:
        kept = os.dup(descriptor)
    except OSError:  # closed: nothing is shown anyway
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, descriptor)
        yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)
        os.close(nowhere)

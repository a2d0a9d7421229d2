"""OpenEXR files: bytes of one or several parts, and opening of files whose content is not trusted.

What the library prints about a file that it opens is not shown.
"""

from __future__ import annotations

import contextlib
import io
import os
import threading
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np
import OpenEXR
from numpy.typing import NDArray

Channels = Mapping[str, NDArray[Any]]
"""Pixels by name of the channel, or of several at once such as `RGB`."""

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""CIE x, y of red, green, blue and white: ITU-R BT.709-6, table 1."""

_ONE_AT_A_TIME = threading.Lock()
"""The standard streams are the process's; two threads that exchanged them at once would leave one of them lost."""


def encode_exr(channels: Channels, attributes: Mapping[str, Any]) -> bytes:
    """Bytes of a file of one part: scan lines, ZIP, Rec.709; equal input gives equal bytes.

    Parameters
    ----------
    channels : mapping of str to ndarray, shape (H, W) or (H, W, C)
        Pixels, float16 or float32.
    attributes : mapping
        Further attributes, and those that take the place of the usual ones.
    """
    return _written(OpenEXR.File(_header(attributes), _contiguous(channels)))


def encode_parts(parts: Iterable[tuple[str, Channels, Mapping[str, Any]]]) -> bytes:
    """Bytes of a file of several parts, each with its name, channels and attributes; otherwise as `encode_exr`."""
    return _written(
        OpenEXR.File([OpenEXR.Part(_header(own), _contiguous(channels), name) for name, channels, own in parts])
    )


def _header(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """A header of its own for each part: the library writes into it."""
    return {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "chromaticities": REC709,
        "software": "rsibr",
        **attributes,
    }


def _contiguous(channels: Channels) -> dict[str, NDArray[Any]]:
    """OpenEXR ignores the strides of an array."""
    return {name: np.ascontiguousarray(pixels) for name, pixels in channels.items()}


def _written(file: Any) -> bytes:
    stream = io.BytesIO()
    with file:
        file.write(stream)
    return stream.getvalue()


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

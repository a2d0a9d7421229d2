"""OpenEXR files of a picture and what is known of it: variance, saturation, marks, each a part of its own.

The channels of the first part are R, G, B, those of the others bear the name of their part, such as `varianceR`. So the
first is the only picture of the file, for rsibr (`environment.file`) and for every other program.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.machine import make_folder
from rsibr.store import exr
from rsibr.store.atomic import read_bytes, write_atomic

Picture = NDArray[np.float32]


def encode_parts(pictures: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any] | None = None) -> bytes:
    """Bytes of an OpenEXR file; equal pictures give equal bytes.

    Parameters
    ----------
    pictures : mapping of str to ndarray, shape (H, W, 3) or (H, W)
        Part of each name, in order; stored as float32, `bool` as 0 and 1.
    attributes : mapping, optional
        Attributes of every part.
    """
    return exr.encode_parts(
        (name, _channels(picture, name if index else ""), attributes or {})
        for index, (name, picture) in enumerate(pictures.items())
    )


def write_parts(
    path: Path | str, pictures: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any] | None = None
) -> None:
    """Write `encode_parts` to a file, atomically; its folder is made if it does not exist.

    Raises
    ------
    MachineError, BakeError
        If it cannot be written.
    """
    make_folder(Path(path).parent)
    write_atomic(Path(path), encode_parts(pictures, attributes))


def read_parts(path: Path) -> dict[str, Picture]:
    """Read a file of `encode_parts`: the picture of each part by its name, in order.

    Raises
    ------
    InputError
        If it is no OpenEXR file, or a part of it has other channels.
    """
    try:
        with exr.open_exr(io.BytesIO(read_bytes(path))) as file:
            return {part.name(): _picture(part, index) for index, part in enumerate(file.parts)}
    except (RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
        raise InputError(
            "is no capture of rsibr, or is truncated", where=str(path), fix="make it with `rsibr capture`"
        ) from error


def part_names(path: Path) -> tuple[str, ...]:
    """Names of the parts of an OpenEXR file, in order; of none that can be read as one, none.

    Raises
    ------
    BakeError
        If the file cannot be read.
    """
    try:
        with exr.open_exr(io.BytesIO(read_bytes(path)), header_only=True) as file:
            return tuple(part.name() for part in file.parts)
    except (RuntimeError, ValueError, TypeError, KeyError, MemoryError):
        return ()


def _channels(picture: NDArray[Any], prefix: str) -> dict[str, Picture]:
    if picture.ndim == 2:
        return {prefix or "Y": np.asarray(picture, dtype=np.float32)}
    return {f"{prefix}{name}": np.asarray(picture[..., k], dtype=np.float32) for k, name in enumerate("RGB")}


def _picture(part: Any, index: int) -> Picture:
    prefix = part.name() if index else ""
    if prefix in part.channels:
        return np.array(part.channels[prefix].pixels, dtype=np.float32)
    if not prefix and "RGB" in part.channels:  # the library puts R, G and B of a part together
        return np.array(part.channels["RGB"].pixels, dtype=np.float32)
    return np.stack([np.array(part.channels[f"{prefix}{name}"].pixels, dtype=np.float32) for name in "RGB"], axis=-1)

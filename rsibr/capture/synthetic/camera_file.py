"""Files of synthetic photographs, with the EXIF data that a camera would write."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.photographs.exif import EXIF_TABLE, F_NUMBER, ISO, SECONDS
from rsibr.capture.photographs.exposure import Exposure
from rsibr.store.atomic import write_atomic

_HEADER_END = 33  # signature, and the chunk IHDR


def write_photograph(path: Path | str, values: NDArray[np.integer], exposure: Exposure | None = None) -> None:
    """Write a photograph as PNG, atomically.

    Parameters
    ----------
    path : path
        File with the ending `.png`.
    values : ndarray, shape (H, W, 3), uint8 or uint16
        Encoded R, G, B.
    exposure : Exposure, optional
        Goes into the EXIF data.
    """
    write_atomic(Path(path), _with_exif(_png(values), exposure))


def _png(values: NDArray[np.integer]) -> bytes:
    import cv2  # noqa: PLC0415

    return bytes(cv2.imencode(".png", np.ascontiguousarray(values[..., ::-1]))[1])


def _with_exif(png: bytes, exposure: Exposure | None) -> bytes:
    """Put a chunk `eXIf` (PNG 3, 11.3.5.2) behind the header: no library writes one into pictures of 16 bits."""
    if exposure is None:
        return png
    from PIL import Image  # noqa: PLC0415

    tags = Image.Exif()
    tags[EXIF_TABLE] = {SECONDS: exposure.seconds, F_NUMBER: exposure.f_number, ISO: round(exposure.iso)}
    named = b"eXIf" + tags.tobytes().removeprefix(b"Exif\0\0")
    chunk = struct.pack(">I", len(named) - 4) + named + struct.pack(">I", zlib.crc32(named))
    return png[:_HEADER_END] + chunk + png[_HEADER_END:]

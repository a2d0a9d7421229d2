"""Files of synthetic photographs, with the EXIF data that a camera would write."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.photographs.exif import EXIF_TABLE, F_NUMBER, ISO, SECONDS
from rsibr.capture.photographs.exposure import Exposure
from rsibr.store.atomic import write_atomic


def write_photograph(path: Path | str, values: NDArray[np.integer], exposure: Exposure | None = None) -> None:
    """Write a photograph as PNG, atomically.

    Parameters
    ----------
    path : path
        File with the ending `.png`.
    values : ndarray, shape (H, W, 3), uint8 or uint16
        Encoded R, G, B.
    exposure : Exposure, optional
        Goes into the EXIF data of 8-bit files; the 16-bit writer has none.
    """
    write_atomic(Path(path), _png16(values) if values.dtype == np.uint16 else _png8(values, exposure))


def _png8(values: NDArray[np.integer], exposure: Exposure | None) -> bytes:
    from PIL import Image  # noqa: PLC0415

    stream = io.BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(values, dtype=np.uint8))
    tags = picture.getexif()
    if exposure is not None:
        tags[EXIF_TABLE] = {SECONDS: exposure.seconds, F_NUMBER: exposure.f_number, ISO: round(exposure.iso)}
    picture.save(stream, "png", exif=tags)
    return stream.getvalue()


def _png16(values: NDArray[np.integer]) -> bytes:
    import cv2  # noqa: PLC0415

    return bytes(cv2.imencode(".png", np.ascontiguousarray(values[..., ::-1]))[1])

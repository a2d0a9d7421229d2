"""Exposure and orientation that a camera wrote into a file's EXIF data."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass

from rsibr.capture.photographs.exposure import Exposure

EXIF_TABLE, SECONDS, F_NUMBER, ISO, ORIENTATION = 0x8769, 33434, 33437, 34855, 0x0112
"""Tags of EXIF 2.3."""


@dataclass(frozen=True)
class ExifData:
    """What a camera said of a photograph.

    Attributes
    ----------
    exposure : Exposure or None
        None if the time is missing. A missing aperture or sensitivity counts as the same in all photographs.
    orientation : int
        1 to 8, as EXIF numbers them; 1: the rows are stored from top to bottom.
    """

    exposure: Exposure | None = None
    orientation: int = 1


def exif_of(data: bytes) -> ExifData:
    """EXIF data of an encoded picture; of one without, or with damaged ones, nothing is known.

    Parameters
    ----------
    data : bytes
        Content of a PNG, JPEG or TIFF file.
    """
    from PIL import Image  # noqa: PLC0415  # only those who read photographs wait for it

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on damaged tags, and on the number of pixels, which are not decoded here
            with Image.open(io.BytesIO(data)) as picture:
                tags = picture.getexif()
                table = tags.get_ifd(EXIF_TABLE)
    except Exception:  # whatever a damaged header makes of the library: nothing is known
        return ExifData()
    orientation = tags.get(ORIENTATION, 1)
    return ExifData(_exposure(table), orientation if orientation in range(1, 9) else 1)


def _exposure(table: dict[int, object]) -> Exposure | None:
    seconds = _positive(table.get(SECONDS))
    if seconds is None:
        return None
    return Exposure(seconds, _positive(table.get(F_NUMBER)) or 1.0, _positive(table.get(ISO)) or 100.0)


def _positive(value: object) -> float | None:
    if isinstance(value, (tuple, list)):  # several sensitivities: the first is the one in use
        value = value[0] if value else None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if 0 < number < float("inf") else None

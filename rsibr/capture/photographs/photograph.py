"""Photograph: pixel values as a file holds them, and the exposure that made them."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.photographs.exif import exif_of
from rsibr.capture.photographs.exposure import Exposure
from rsibr.capture.photographs.jpeg_check import complaints, is_cut_short, is_jpeg
from rsibr.errors import InputError, MachineError
from rsibr.regular_file import NotRegularError, read_regular
from rsibr.scene.panorama.rec709 import rec709_picture

MOST_PIXELS = 2**29
"""Largest number of pixels of a photograph."""

_LINEAR = (".exr", ".hdr", ".pic", ".rgbe")
_RAW = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef")
_KNOWN = "PNG, JPEG, TIFF, EXR, HDR, or a camera's raw file"


@dataclass(frozen=True, eq=False)
class Photograph:
    """Pixels of a photograph, upright.

    Attributes
    ----------
    values : ndarray, shape (H, W, 3), float32
        R, G, B, row 0 at the top. Encoded values in [0, 1] of a file of integers; of a linear file, exposure in the
        units of the file.
    levels : int
        Largest integer of the file, 255 or 65535; 0: the values were stored as floats.
    is_linear : bool
        Whether the values are proportional to radiance, so that no response curve applies: OpenEXR, Radiance, raw.
    exposure : Exposure or None
        From EXIF, or as given; None if unknown.
    name : str
        File that messages name.
    """

    values: NDArray[np.float32]
    levels: int
    is_linear: bool
    exposure: Exposure | None
    name: str

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.values.shape[1], self.values.shape[0]

    def exposed(self, exposure: Exposure) -> Photograph:
        """The photograph with an exposure that is known better than its file does."""
        return replace(self, exposure=exposure)


def read_photograph(path: Path | str) -> Photograph:
    """Read a photograph, and turn it upright as its EXIF orientation says.

    Parameters
    ----------
    path : path
        PNG or TIFF of 8 or 16 bits, JPEG, OpenEXR, Radiance HDR; raw files with the extra `rsibr[raw]`.

    Returns
    -------
    Photograph
        Colours of integer files are taken as they are: encoded by the camera's curve, with Rec.709 primaries.

    Raises
    ------
    InputError
        If there is no such file, it is no picture, it is too large, or it is a JPEG whose decoder tells of damage.
    MachineError
        If the package that reads it is not installed.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind in _LINEAR:
        _, image, _ = rec709_picture(path, MOST_PIXELS)
        return Photograph(image, 0, True, None, str(path))
    data = _content(path)
    known = exif_of(data)
    if kind in _RAW:
        return Photograph(_developed(data, str(path)), 65535, True, known.exposure, str(path))
    values, levels = _decoded(data, str(path))
    return Photograph(_upright(values, known.orientation), levels, False, known.exposure, str(path))


def _content(path: Path) -> bytes:
    try:
        return read_regular(path)
    except FileNotFoundError as error:
        raise InputError("there is no such photograph", where=str(path), fix="check its name") from error
    except (NotRegularError, OSError) as error:
        raise InputError(str(error.strerror or error), where=str(path), fix=f"give {_KNOWN}") from error


def _decoded(data: bytes, where: str) -> tuple[NDArray[np.float32], int]:
    """R, G, B in [0, 1] and the largest integer of a PNG, JPEG or TIFF."""
    picture = _sound_jpeg(data, where) if is_jpeg(data) else _picture(data, where)
    if picture is None:
        raise InputError("is no picture that can be decoded", where=where, fix=f"give {_KNOWN}")
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    if picture.shape[2] == 2:
        raise InputError("has two channels", where=where, fix="save it in grey or in RGB")
    if picture.shape[0] * picture.shape[1] > MOST_PIXELS:
        raise InputError(f"has more than {MOST_PIXELS} pixels", where=where, fix="scale it down")
    colours = picture[..., 2::-1]  # OpenCV has B, G, R
    if picture.dtype not in (np.uint8, np.uint16):
        what = f"holds values of the type {picture.dtype}"
        raise InputError(what, where=where, fix="save it with 8 or 16 bits, or as OpenEXR")
    levels = int(np.iinfo(picture.dtype).max)
    return np.ascontiguousarray(colours, dtype=np.float32) / np.float32(levels), levels


def _picture(data: bytes, where: str) -> Any:
    """What OpenCV makes of a file; None if it is no picture."""
    cv2 = opencv()
    try:
        # The orientation is applied by `_upright`: this flag would leave 16 bits out
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    except cv2.error as error:
        raise InputError(f"cannot be decoded: {error.err}", where=where, fix=f"give {_KNOWN}") from error


def _sound_jpeg(data: bytes, where: str) -> Any:
    """Decode a JPEG; an InputError if the decoder had to guess."""
    if is_cut_short(data):
        raise InputError("is cut short: its end marker is missing", where=where, fix="copy it from the camera again")
    with complaints() as found:
        picture = _picture(data, where)
    if found:
        raise InputError(f"is damaged: {found[0]}", where=where, fix="copy it from the camera again")
    return picture


_TURNS: dict[int, Callable[[NDArray[np.float32]], NDArray[np.float32]]] = {
    1: lambda image: image,
    2: lambda image: image[:, ::-1],
    3: lambda image: image[::-1, ::-1],
    4: lambda image: image[::-1],
    5: lambda image: image.transpose(1, 0, 2),
    6: lambda image: image.transpose(1, 0, 2)[:, ::-1],
    7: lambda image: image.transpose(1, 0, 2)[::-1, ::-1],
    8: lambda image: image.transpose(1, 0, 2)[::-1],
}
"""Upright picture by EXIF orientation."""


def _upright(values: NDArray[np.float32], orientation: int) -> NDArray[np.float32]:
    return np.ascontiguousarray(_TURNS[orientation](values))


def _developed(data: bytes, where: str) -> NDArray[np.float32]:
    """Linear R, G, B in [0, 1] of a raw file, as the camera balanced white."""
    try:
        import rawpy  # type: ignore[import-not-found,unused-ignore]  # noqa: PLC0415
    except ImportError as error:
        raise MachineError(
            "raw files need the package rawpy",
            where=where,
            fix="pip install 'rsibr[raw]', or convert it to 16-bit TIFF",
        ) from error
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            picture = raw.postprocess(gamma=(1, 1), no_auto_bright=True, output_bps=16, use_camera_wb=True)
    except rawpy.LibRawError as error:
        raise InputError(f"cannot be decoded: {error}", where=where, fix=f"give {_KNOWN}") from error
    return np.asarray(picture, dtype=np.float32) / np.float32(65535)


def opencv() -> Any:
    """The package OpenCV; a MachineError where it is not installed."""
    try:
        import cv2  # noqa: PLC0415
    except ImportError as error:
        fix = "pip install 'rsibr[capture]'"
        raise MachineError("photographs need the package opencv-python-headless", fix=fix) from error
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # our error says it
    return cv2

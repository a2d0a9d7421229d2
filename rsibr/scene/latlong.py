"""Latitude–longitude radiance maps from OpenEXR and Radiance HDR files, validated texel by texel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene.plugin import mitsuba_errors

_EXR_MAGIC = b"\x76\x2f\x31\x01"
_HDR_MAGIC = b"#?"
_HDR_XYZ = b"32-bit_rle_xyze"

MAX_TEXELS = 2**30
"""Largest number of texels: Mitsuba indexes the four floats a texel of an envmap with 32 bits."""


@dataclass(frozen=True, eq=False)
class LatLong:
    """Latitude–longitude map.

    Attributes
    ----------
    image : ndarray (H, W, 3), float32
        Radiance [W sr⁻¹ m⁻²], scene-linear Rec.709, finite and not negative. Row 0 is at +Y, the columns start at −Z
        and pass +X.
    clipped : int
        Number of values (channels of texels) that were negative and were set to 0.
    lowest : float
        Lowest of these values; 0 if there was none.
    """

    image: NDArray[np.float32]
    clipped: int
    lowest: float


def read_latlong(path: Path, most_texels: int = MAX_TEXELS) -> LatLong:
    """Read a latitude–longitude map.

    Parameters
    ----------
    path : Path
        OpenEXR (half or float; RGB, RGBA, a single channel Y, or one RGB layer; the first part of several) or Radiance
        HDR (RGBE). Any aspect ratio. An EXR that states its primaries is converted to Rec.709.
    most_texels : int
        Texels at most.

    Raises
    ------
    InputError
        If the file is missing, truncated or of another format, has other channels, shows only a part of its panorama,
        or contains NaN or Inf; the message names file, texel and channel.

    Notes
    -----
    `mi.Bitmap` reads both formats without a variant and, unlike `OpenEXR.File`, raises on a truncated file.
    """
    is_exr = _is_exr(path)
    with backend.loading(), mitsuba_errors(str(path), "save it again as OpenEXR or Radiance HDR; it may be truncated"):
        bitmap = mi.Bitmap(str(path))
        pixels = np.array(bitmap)
        names = [field.name for field in bitmap.struct_()]
    if is_exr:
        _check_whole_panorama(path)
    if pixels.shape[0] * pixels.shape[1] > most_texels:
        height, width = pixels.shape[:2]
        raise InputError(
            f"{width} × {height} texels are more than {most_texels}", where=str(path), fix="scale the map down"
        )
    image = _rgb(pixels.reshape(*pixels.shape[:2], -1), names, path)
    _check_finite(image, path)
    negative = image < 0.0
    lowest = float(image.min())
    return LatLong(np.where(negative, np.float32(0.0), image), int(negative.sum()), min(lowest, 0.0))


def _is_exr(path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
    except FileNotFoundError:
        raise InputError("there is no such environment map", where=str(path), fix="check the path") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path)) from None
    if not head.startswith((_EXR_MAGIC, _HDR_MAGIC)):
        raise InputError("is neither OpenEXR nor Radiance HDR", where=str(path), fix="convert it to one of them")
    if head.startswith(_HDR_MAGIC) and _HDR_XYZ in head:
        raise InputError("holds XYZ, not RGB", where=str(path), fix="convert it to RGBE or OpenEXR")
    return head.startswith(_EXR_MAGIC)


def _check_whole_panorama(path: Path) -> None:
    with mitsuba_errors(
        str(path), "save it again as OpenEXR; its header is damaged"
    ):  # raises the same errors as Mitsuba
        header = OpenEXR.File(str(path), header_only=True).header(0)
    if not np.array_equal(np.ravel(header["dataWindow"]), np.ravel(header["displayWindow"])):
        raise InputError(
            "shows only a part of its panorama (data and display window differ)",
            where=str(path),
            fix="save it with one window",
        )


def _rgb(pixels: NDArray[np.generic], names: list[str], path: Path) -> NDArray[np.float32]:
    if not np.issubdtype(pixels.dtype, np.floating):
        raise InputError(f"holds {pixels.dtype}, not radiance", where=str(path), fix="save it as half or float")
    layers = sorted(name[:-1] for name in names if name.endswith("R") and {name[:-1] + c for c in "GB"} <= set(names))
    if layers:
        chosen = [names.index(layers[0] + channel) for channel in "RGB"]
    elif "Y" in names and "RY" not in names:
        chosen = [names.index("Y")] * 3
    else:
        raise InputError(
            f"has the channels {', '.join(names)}, no R, G, B and no single Y", where=str(path), fix="save it as RGB"
        )
    return np.ascontiguousarray(pixels[..., chosen], dtype=np.float32)


def _check_finite(image: NDArray[np.float32], path: Path) -> None:
    bad = np.argwhere(~np.isfinite(image))
    if not len(bad):
        return
    row, column, channel = bad[0]
    value = "NaN" if np.isnan(image[row, column, channel]) else "Inf"
    more = f"; {len(bad) - 1} more values are not finite" if len(bad) > 1 else ""
    raise InputError(
        f"texel (row {row}, column {column}) is {value} in channel {'RGB'[channel]}{more}",
        where=str(path),
        fix="paint it over: a single such texel spoils every map",
    )

"""Scene-linear pictures in Rec.709 from OpenEXR and Radiance HDR files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.colour import to_rec709
from rsibr.scene.panorama.exr import read_exr
from rsibr.scene.panorama.exr_channels import KEY
from rsibr.scene.panorama.picture import Picture
from rsibr.scene.panorama.radiance_hdr import read_radiance
from rsibr.scene.panorama.source import is_exr


def rec709_picture(
    path: Path, most_texels: int, layer: str | None = None
) -> tuple[Picture, NDArray[np.float32], tuple[str, ...]]:
    """Read a picture, and convert its colours.

    Parameters
    ----------
    path : Path
        OpenEXR or Radiance HDR file.
    most_texels : int
        Largest number of texels.
    layer : str, optional
        Layer of an OpenEXR file that has several pictures.

    Returns
    -------
    picture : Picture
        As the file holds it.
    image : ndarray (H, W, 3), float32
        Scene-linear Rec.709, finite; negative values are possible.
    notes : tuple of str
        What the user should know of the reading.

    Raises
    ------
    InputError
        If the file cannot be read, holds no picture, is too large, or has a value that is not finite.
    """
    picture = _read(path, most_texels, layer)
    image, notes = to_rec709(picture, str(path))
    _check_finite(image, path)
    return picture, image, (*picture.notes, *notes)


def _read(path: Path, most_texels: int, layer: str | None) -> Picture:
    if is_exr(path):
        return read_exr(path, layer, most_texels)
    if layer is not None:
        raise InputError("is a Radiance HDR, which has no layers", where=str(path), fix=f"leave out {KEY}")
    return read_radiance(path, most_texels)


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

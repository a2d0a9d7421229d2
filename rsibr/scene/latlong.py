"""Latitude–longitude radiance maps from OpenEXR and Radiance HDR files, validated texel by texel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.colour import to_rec709
from rsibr.scene.panorama.exr import read_exr
from rsibr.scene.panorama.exr_channels import KEY
from rsibr.scene.panorama.layout import aspect_notes, from_cube, without_seam
from rsibr.scene.panorama.picture import Picture
from rsibr.scene.panorama.radiance_hdr import read_radiance
from rsibr.scene.panorama.source import is_exr

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
    turn : float
        Angle [rad] about +Y, by which the map is to be turned to lie as its file says: half a texel or 0.
    notes : tuple of str
        What was converted, cut off or left aside, and what looks odd; a sentence each.
    """

    image: NDArray[np.float32]
    clipped: int
    lowest: float
    turn: float = 0.0
    notes: tuple[str, ...] = ()


def read_latlong(path: Path, most_texels: int = MAX_TEXELS, layer: str | None = None) -> LatLong:
    """Read a latitude–longitude map, or a picture that its header describes and that can be converted to one.

    Parameters
    ----------
    path : Path
        OpenEXR (half or float; RGB, XYZ or a single Y; any window, tiles or scan lines) or Radiance HDR (RGBE, any
        order of its texels). Any aspect ratio.
    most_texels : int
        Texels at most.
    layer : str, optional
        Layer, part or view of an OpenEXR file with several pictures; see `rsibr.scene.panorama.exr_channels.choose`.

    Raises
    ------
    InputError
        If the file is missing, truncated, damaged or of another format, holds several pictures and none is chosen,
        shows only a part of its panorama, states what cannot be obeyed, or contains NaN or Inf; the message names file,
        texel and channel.

    Notes
    -----
    Obeyed are, of OpenEXR, the windows, `envmap`, `chromaticities`, `colorInteropID`, `acesImageContainerFlag`,
    `adoptedNeutral` and `multiView`; of Radiance, FORMAT, EXPOSURE, COLORCORR, PRIMARIES, GAMMA and the resolution
    line. Whatever else a header says (`pixelAspectRatio`, PIXASPECT, `screenWindowWidth`, …) does not change a picture
    that shows the whole sphere.
    """
    path = Path(path)
    picture = _read(path, most_texels, layer)
    image, notes = to_rec709(picture, str(path))
    _check_finite(image, path)
    turn = 0.0
    if picture.layout == "latlong":
        image, turn = without_seam(image)
        notes += ("its envmap attribute puts the first and the last column into one direction; obeyed",)
    elif picture.layout == "cube":
        image = from_cube(image, most_texels, str(path))
        notes += (f"its cube was converted to {image.shape[1]} × {image.shape[0]} texels of latitude and longitude",)
    else:
        notes += aspect_notes(*image.shape[:2])
    negative = image < 0.0
    lowest = float(image.min())
    return LatLong(
        image=np.where(negative, np.float32(0.0), image),
        clipped=int(negative.sum()),
        lowest=min(lowest, 0.0),
        turn=turn,
        notes=(*picture.notes, *notes),
    )


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

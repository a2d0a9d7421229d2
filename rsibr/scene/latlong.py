"""Latitude–longitude radiance maps from OpenEXR and Radiance HDR files in any projection, validated texel by texel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.face_borders import unfit_faces
from rsibr.scene.panorama.faces import stacked_faces
from rsibr.scene.panorama.layout import aspect_notes, without_seam
from rsibr.scene.panorama.rec709 import rec709_picture
from rsibr.scene.panorama.resampled import KEY as PROJECTION_KEY
from rsibr.scene.panorama.resampled import environment_projection, sheets_of, to_latlong

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
    sheets : ndarray (F, h, w, 3), float32, or None
        Texels before they were converted from another projection. They identify the map: a conversion may differ from
        machine to machine in its last bits.
    projection : str
        Projection of `sheets`.
    """

    image: NDArray[np.float32]
    clipped: int
    lowest: float
    turn: float = 0.0
    notes: tuple[str, ...] = ()
    sheets: NDArray[np.float32] | None = None
    projection: str = "latlong"


_STATED = {"latlong": "latlong-openexr", "cube": "cube-openexr"}
"""Projection that OpenEXR's attribute `envmap` states."""


def read_latlong(
    path: Path, most_texels: int = MAX_TEXELS, layer: str | None = None, projection: str | None = None
) -> LatLong:
    """Read an environment, and convert it to a latitude–longitude map if it is none.

    Parameters
    ----------
    path : Path
        OpenEXR (half or float; RGB, XYZ or a single Y; any window, tiles or scan lines) or Radiance HDR (RGBE, any
        order of its texels). Any aspect ratio, if it is of latitude and longitude.
    most_texels : int
        Texels at most.
    layer : str, optional
        Layer, part or view of an OpenEXR file with several pictures; see `rsibr.scene.panorama.exr_channels.choose`.
    projection : str, optional
        Name of the projection (`rsibr.geometry.projections.projection`); by default what the header states, or else
        "latlong".

    Raises
    ------
    InputError
        If the file is missing, truncated, damaged or of another format, holds several pictures and none is chosen,
        shows only a part of its panorama, states what cannot be obeyed, has not the shape of its projection, or
        contains NaN or Inf; the message names file, texel and channel.

    Notes
    -----
    Obeyed are, of OpenEXR, the windows, `envmap`, `chromaticities`, `colorInteropID`, `acesImageContainerFlag`,
    `adoptedNeutral` and `multiView`; of Radiance, FORMAT, EXPOSURE, COLORCORR, PRIMARIES, GAMMA and the resolution
    line. Whatever else a header says (`pixelAspectRatio`, PIXASPECT, `screenWindowWidth`, …) does not change a picture
    that shows the whole sphere.
    """
    path = Path(path)
    picture, image, notes = rec709_picture(path, most_texels, layer)
    stated = _STATED.get(picture.layout)
    if projection is not None and stated not in (None, projection):
        raise InputError(
            f"its envmap attribute says {picture.layout}, and {PROJECTION_KEY} '{projection}'",
            where=str(path),
            fix=f"leave out {PROJECTION_KEY}",
        )
    name, turn = projection if projection is not None else stated or "latlong", 0.0
    sheets = None
    if name == "latlong-openexr":  # the mean of the seam's columns, before negative values are cut off
        image, turn = without_seam(image)
    image, clipped, lowest = _without_negatives(image)
    if name == "latlong-openexr":
        by = "environment.projection" if stated is None else "its envmap attribute"
        notes += (f"{by} puts the first and the last column into one direction; obeyed",)
    elif name != "latlong":
        if stated == "cube-openexr":
            _check_is_column(image, str(path))
        image, sheets, note = _from_picture(image, name, most_texels, str(path))
        notes += (note,)
    elif projection is None:
        notes += aspect_notes(*image.shape[:2])
    return LatLong(image, clipped, lowest, turn, notes, sheets, name)


def read_faces(
    paths: Mapping[str, Path], most_texels: int = MAX_TEXELS, layer: str | None = None, projection: str = "cube"
) -> LatLong:
    """Read six faces of a cube, and convert them to a latitude–longitude map.

    Parameters
    ----------
    paths : dict of str to Path
        Files of the faces px, nx, py, ny, pz, nz; each as in `read_latlong`.
    most_texels, layer
        As in `read_latlong`.
    projection : str
        Orientation of the faces: a projection with six sheets, "cube" or "cube-openexr".

    Raises
    ------
    InputError
        As in `read_latlong`; or if faces differ in size, are not square, or state a panorama themselves.
    """
    of = environment_projection(projection)
    if of.sheets != len(paths):
        raise InputError(f"'{projection}' has no six faces", where=PROJECTION_KEY, fix="use cube or cube-openexr")
    images: dict[str, NDArray[np.float32]] = {}
    notes: list[str] = []
    for face, path in paths.items():
        picture, images[face], told = rec709_picture(path, most_texels, layer)
        notes += [f"{face}: {note}" for note in told]
        if picture.layout != "plain":
            raise InputError(
                f"its envmap attribute says {picture.layout}: it is no face of a cube",
                where=str(path),
                fix="give it as environment.file",
            )
    sheets, clipped, lowest = _without_negatives(stacked_faces(images, paths))
    image = to_latlong(sheets, of, most_texels, str(paths["px"]))
    notes += filter(None, [unfit_faces(sheets, of)])
    notes.append(f"its six faces were converted to {_size(image)} texels of latitude and longitude")
    return LatLong(image, clipped, lowest, 0.0, tuple(notes), sheets, of.name)


def _from_picture(
    image: NDArray[np.float32], name: str, most_texels: int, where: str
) -> tuple[NDArray[np.float32], NDArray[np.float32], str]:
    """Map, sheets and a note of a picture in a projection."""
    of = environment_projection(name)
    sheets, layout = sheets_of(image, of, where)
    converted = to_latlong(sheets, of, most_texels, where)
    what = "cube" if of.sheets == 6 else f"'{name}'"
    kind = f" ({layout})" if of.sheets > 1 else ""
    return converted, sheets, f"its {what} was converted to {_size(converted)} texels of latitude and longitude{kind}"


def _without_negatives(image: NDArray[np.float32]) -> tuple[NDArray[np.float32], int, float]:
    """Image with negative values set to 0, their number, and the lowest of them or 0."""
    negative = image < 0.0
    return np.where(negative, np.float32(0.0), image), int(negative.sum()), min(float(image.min()), 0.0)


def _check_is_column(image: NDArray[np.float32], where: str) -> None:
    """OpenEXR's cube has its faces one below the other, and no other layout."""
    height, width = image.shape[:2]
    if height != 6 * width:
        raise InputError(
            f"its envmap attribute says cube, but {width} × {height} texels are not six square faces",
            where=where,
            fix="save it with its faces +X, −X, +Y, −Y, +Z, −Z one below the other",
        )


def _size(image: NDArray[np.float32]) -> str:
    return f"{image.shape[1]} × {image.shape[0]}"

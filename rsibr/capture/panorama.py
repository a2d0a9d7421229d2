"""Panorama: a latitude–longitude map that was put together, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.exr_parts import write_parts
from rsibr.errors import InputError
from rsibr.geometry.projections.latlong import MITSUBA
from rsibr.geometry.projections.sphere_image import SphereImage, converted

LEAST_HEIGHT, _MOST_HEIGHT = 3, 16384
SOURCE_KEY = "rsibr:source"
"""Attribute of a written map that says where it comes from."""


@dataclass(frozen=True, eq=False)
class Panorama:
    """Latitude–longitude map in Mitsuba's orientation.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, 3), float32
        Scene-linear Rec.709.
    source : str
        Where it comes from, in words; written into the file.
    notes : tuple of str
        What the user should know.
    """

    radiance: NDArray[np.float32]
    source: str
    notes: tuple[str, ...] = ()

    def write(self, path: Path | str) -> None:
        """Write the map as OpenEXR, atomically; it can be given as `environment.file`."""
        write_parts(path, {"radiance": self.radiance}, {SOURCE_KEY: self.source})


def as_latlong(image: SphereImage, height: int) -> NDArray[np.float32]:
    """Convert an image of the sphere to Mitsuba's latitude and longitude, shape (H, W, 3).

    Parameters
    ----------
    image : SphereImage
        Of the whole sphere.
    height : int
        Rows, 3 to 16 384; twice as many columns, or as many as steps of an odd number of rows.

    Raises
    ------
    InputError
        If the height is out of range.
    """
    if not LEAST_HEIGHT <= height <= _MOST_HEIGHT:
        raise InputError(f"{height} rows", where="height", fix=f"give {LEAST_HEIGHT} to {_MOST_HEIGHT}")
    values = converted(image, MITSUBA, (height, 2 * (height - 1) if height % 2 else 2 * height)).values[0]
    return np.asarray(values, dtype=np.float32)

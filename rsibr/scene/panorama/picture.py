"""Picture as a file holds it, with what its header says about colour and layout."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Chromaticities = tuple[float, float, float, float, float, float, float, float]
"""CIE x, y of red, green, blue and white."""

Point = tuple[float, float]
"""CIE x, y of one colour."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Decoded picture, upright, before colours and layout are converted.

    Attributes
    ----------
    image : ndarray (H, W, 3), float32
        Values as stored, scaled to scene-linear ones; row 0 at the top.
    xyz : bool
        Whether the channels are CIE XYZ, not RGB.
    chromaticities : tuple of 8 floats, or None
        Primaries and white of the RGB values; None: Rec.709.
    neutral : tuple of 2 floats, or None
        Colour that is to look neutral, where the header states one besides the white.
    layout : {"plain", "latlong", "cube"}
        `plain`: the header states none, which is read as Mitsuba lays out an envmap. `latlong`, `cube`: those of
        OpenEXR's attribute `envmap`.
    notes : tuple of str
        What the user should know of the reading.
    """

    image: NDArray[np.float32]
    xyz: bool = False
    chromaticities: Chromaticities | None = None
    neutral: Point | None = None
    layout: str = "plain"
    notes: tuple[str, ...] = field(default=())

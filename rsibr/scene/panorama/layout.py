"""Layout of a panorama that its shape or OpenEXR's latitude–longitude attribute tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]

_LOOKS_LIKE = (
    (1, 1, "a light probe (mirror ball, angular map), an octahedral map, or two panoramas one above the other"),
    (3, 4, "a vertical cross of a cube"),
    (4, 3, "a horizontal cross of a cube, or a photograph"),
    (6, 1, "a strip of the faces of a cube"),
    (1, 6, "a strip of the faces of a cube"),
    (3, 2, "the faces of a cube in two rows, or a photograph"),
    (2, 3, "the faces of a cube in three rows, or a photograph"),
)

_NEAR = 0.01
"""Relative difference up to which an aspect ratio counts as one of these."""


def aspect_notes(height: int, width: int) -> tuple[str, ...]:
    """Note that a picture without a stated layout looks like another than latitude–longitude, by its aspect ratio.

    Examples
    --------
    >>> aspect_notes(512, 1024)
    ()
    """
    if height * width == 1:
        return ()
    for across, down, what in _LOOKS_LIKE:
        if abs(width * down / (height * across) - 1.0) <= _NEAR:
            looks = f"its {width} × {height} texels ({across}:{down}) look like {what}"
            return (f"{looks}; read as latitude–longitude: environment.projection names another",)
    return ()


def without_seam(image: Image) -> tuple[Image, float]:
    """Convert OpenEXR's latitude–longitude map, whose first and last columns both show −Z.

    Parameters
    ----------
    image : ndarray (H, W, 3)
        Map of the attribute `envmap = latlong`: texel centres at u = i/(W−1), v = j/(H−1).

    Returns
    -------
    image : ndarray (H, W − 1, 3)
        The same texels; those of the first and the last column became their mean. The same image if W is 1.
    turn : float
        Angle [rad] about +Y by which Mitsuba's envmap of it, whose texel centres are at u = (i+½)/(W−1), is to be
        turned.

    Notes
    -----
    `LatLongMap::direction` in OpenEXR's ImfEnvmap.cpp. Rows lie as Mitsuba's, and u = 0, ¼, ½, ¾ are −Z, +X, +Z, −X in
    both. Turning in place of resampling leaves every other texel as it is.
    """
    width = image.shape[1]
    if width == 1:
        return image, 0.0
    whole = image[:, :-1].copy()
    whole[:, 0] = 0.5 * image[:, 0] + 0.5 * image[:, -1]
    return whole, np.pi / (width - 1)

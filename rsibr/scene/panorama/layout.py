"""Layouts of a panorama, converted to that of Mitsuba's envmap: OpenEXR's latitude–longitude map and cube."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError

Image = NDArray[np.float32]

DENSITY = 2
"""Texels of the map made from a cube, for each texel at the middle of a face, along a side."""

_SAMPLES = 2
"""Samples of the cube a texel of the map along a side: at a corner its texels are 3 times as fine as amid a face."""

_ROWS_AT_ONCE = 64

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
            return (f"its {width} × {height} texels ({across}:{down}) look like {what}; read as latitude–longitude",)
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


def from_cube(image: Image, most_texels: int, where: str) -> Image:
    """Convert OpenEXR's cube map to a latitude–longitude map as Mitsuba's envmap lays it out.

    Parameters
    ----------
    image : ndarray (6N, N, 3)
        Map of the attribute `envmap = cube`: the faces +X, −X, +Y, −Y, +Z, −Z, one below the other. The outer texel
        centres of a face lie on the edges of the cube.
    most_texels : int
        Texels at most.
    where : str
        File that an error names.

    Returns
    -------
    ndarray (4(N−1)+1, 8(N−1), 3), float32
        Means of 2 × 2 bilinear samples of the cube a texel.

    Raises
    ------
    InputError
        If the picture is not six square faces, or the map would have too many texels.
    """
    side = image.shape[1]
    if image.shape[0] != 6 * side:
        raise InputError(
            f"its envmap attribute says cube, but {side} × {image.shape[0]} texels are not six square faces",
            where=where,
            fix="save it with its faces +X, −X, +Y, −Y, +Z, −Z one below the other",
        )
    steps = max(side - 1, 1)
    height, width = 2 * DENSITY * steps + 1, 4 * DENSITY * steps
    if height * width > most_texels:
        raise InputError(
            f"the map of {width} × {height} texels that its cube needs has more than {most_texels}",
            where=where,
            fix="scale the cube down",
        )
    faces = image.reshape(6, side, side, 3)
    result = np.empty((height, width, 3), np.float32)
    for first in range(0, height, _ROWS_AT_ONCE):
        rows = np.arange(first, min(first + _ROWS_AT_ONCE, height))
        result[rows] = np.mean(
            [_look_up(faces, _directions(rows + dy, height, width, dx)) for dy in _offsets() for dx in _offsets()],
            axis=0,
        )
    return result


def _offsets() -> NDArray[np.float64]:
    return (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5


def _directions(rows: NDArray[np.float64], height: int, width: int, dx: float) -> NDArray[np.float64]:
    """Directions (rows, W, 3) of points of texels; a row beyond a pole goes on down the other side, as it should."""
    polar = np.pi * rows[:, None] / (height - 1)
    azimuth = 2.0 * np.pi * (np.arange(width)[None, :] + 0.5 + dx) / width
    x, z = np.sin(polar) * np.sin(azimuth), -np.sin(polar) * np.cos(azimuth)
    return np.stack([x, np.broadcast_to(np.cos(polar), x.shape), z], axis=-1)


def _look_up(faces: Image, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate the faces (6, N, N, 3) bilinearly in directions (…, 3); ImfEnvmap.cpp, `faceAndPixelPosition`."""
    x, y, z = np.moveaxis(directions, -1, 0)
    size = np.abs(directions)
    axis = np.argmax(size, axis=-1)  # of equal ones the first, as there
    largest = np.take_along_axis(size, axis[..., None], -1)[..., 0]
    negative = np.take_along_axis(directions, axis[..., None], -1)[..., 0] < 0.0
    # Column and row, −1 … 1, in each face as it is stored: the diagram in ImfEnvmap.h
    columns = np.choose(axis, [np.where(negative, -z, z), x, np.where(negative, x, -x)]) / largest
    rows = np.choose(axis, [-y, np.where(negative, z, -z), -y]) / largest
    last = faces.shape[1] - 1
    column, row = (columns + 1.0) / 2.0 * last, (rows + 1.0) / 2.0 * last
    left, top = (np.clip(np.floor(at).astype(int), 0, max(last - 1, 0)) for at in (column, row))
    right, below = np.minimum(left + 1, last), np.minimum(top + 1, last)
    across, down = (column - left)[..., None], (row - top)[..., None]
    face = 2 * axis + negative
    upper = faces[face, top, left] * (1.0 - across) + faces[face, top, right] * across
    lower = faces[face, below, left] * (1.0 - across) + faces[face, below, right] * across
    interpolated: NDArray[np.float64] = upper * (1.0 - down) + lower * down
    return interpolated

"""Places on the rim of a sphere, from what a user marks: a circle, or a mask."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError

_POINTS = 256


def circle_places(x: float, y: float, radius: float) -> NDArray[np.float64]:
    """Places on a circle [pixels], shape (256, 2).

    Raises
    ------
    InputError
        If the radius is not positive.
    """
    if not (np.isfinite([x, y, radius]).all() and radius > 0):
        raise InputError(f"a circle of radius {radius:g}", where="circle", fix="give X,Y,RADIUS in pixels")
    turn = np.linspace(0, 2 * np.pi, _POINTS, endpoint=False)
    return np.stack([x + radius * np.cos(turn), y + radius * np.sin(turn)], axis=1)


def mask_places(mask: NDArray[np.floating], where: str = "mask") -> NDArray[np.float64]:
    """Places on the outline of a mask [pixels], shape (n, 2): where it crosses ½ between neighbouring pixels.

    Parameters
    ----------
    mask : ndarray, shape (H, W)
        1 inside the sphere, 0 outside; shares of pixels on the rim make the places exact.
    where : str
        File that an error names.

    Raises
    ------
    InputError
        If nothing is inside, or the sphere is cut by the edge of the picture on all sides.
    """
    inside = np.asarray(mask, dtype=np.float64)
    across = _crossings(inside)
    down = _crossings(inside.T)[:, ::-1]
    places = np.concatenate([across, down])
    if not len(places):
        raise InputError("has no outline: all of it is inside, or outside", where=where, fix="paint the sphere white")
    return places


def _crossings(inside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places where a row crosses ½, interpolated between the middles of its pixels."""
    left, right = inside[:, :-1], inside[:, 1:]
    row, column = np.nonzero((left < 0.5) != (right < 0.5))
    share = (0.5 - left[row, column]) / (right[row, column] - left[row, column])
    return np.stack([column + 0.5 + share, row + 0.5], axis=1)

"""Small lights in a latitude–longitude map, with their energy and direction.

Mitsuba interpolates the texels of an `envmap` bilinearly in longitude and colatitude: a texel of radiance L is a hat,
and adds L times the integral of its hat over the sphere to the irradiance of a surface that faces it. A light shares
its irradiance out among the four texels around its direction by their bilinear weights, each divided by that integral.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.geometry.projections.latlong import MITSUBA
from rsibr.geometry.projections.sphere_image import texel_directions


def hat_integrals(height: int, width: int) -> NDArray[np.float64]:
    """Integral over the sphere of a texel's hat [sr], by row, shape (height,); rows 0 and H−1 lie on the poles.

    Examples
    --------
    >>> round(float(hat_integrals(33, 64).sum() * 64 / (4 * np.pi)), 12)
    1.0
    """
    step = np.pi / (height - 1)
    colatitude = np.arange(height) * step
    rings = np.sin(colatitude) * (2 - 2 * np.cos(step)) / step
    rings[[0, -1]] = 1 - np.sin(step) / step
    return np.asarray(rings * 2 * np.pi / width)


def add_light(image: NDArray[np.floating], directions: ArrayLike, irradiance: ArrayLike) -> NDArray[np.float32]:
    """Add lights from some directions to a map.

    Parameters
    ----------
    image : ndarray, shape (H, W, 3)
        Latitude–longitude map in Mitsuba's orientation.
    directions : array_like, shape (n, 3)
        Unit directions toward the lights.
    irradiance : array_like, shape (n, 3)
        Irradiance of each on a surface that faces it [W m⁻²].

    Returns
    -------
    ndarray, shape (H, W, 3), float32

    Notes
    -----
    The sum is exact; the mean direction errs by a small part of a texel, since rows nearer to the equator are wider.
    All texels of a row on a pole lie in one direction: what falls on it is spread over the row.
    """
    height, width = image.shape[:2]
    toward = np.asarray(directions, dtype=np.float64).reshape(-1, 3)
    energy = np.asarray(irradiance, dtype=np.float64).reshape(-1, 3)
    column, row = _place(toward, height, width)
    left, top = np.floor(column).astype(int), np.clip(np.floor(row).astype(int), 0, height - 2)
    across, down = column - left, row - top
    integrals, lit = hat_integrals(height, width), np.array(image, dtype=np.float64)
    for dx, share_x in ((0, 1 - across), (1, across)):
        for dy, share_y in ((0, 1 - down), (1, down)):
            rows = top + dy
            inner, share = (rows > 0) & (rows < height - 1), share_x * share_y / integrals[rows]
            np.add.at(lit, (rows[inner], (left[inner] + dx) % width), (energy * share[:, None])[inner])
            np.add.at(lit, rows[~inner], (energy * share[:, None])[~inner, None] / width)
    return lit.astype(np.float32)


def _place(toward: NDArray[np.float64], height: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and rows, counted from the first texel's centre."""
    x, y, z = toward.T
    turn = np.arctan2(x, -z) / (2 * np.pi)  # −Z at 0, +X at a quarter
    colatitude = np.arctan2(np.hypot(x, z), y)
    return (turn % 1.0) * width - 0.5, colatitude / np.pi * (height - 1)


def radiance_integral(image: NDArray[np.floating], direction: ArrayLike, half_angle: float) -> NDArray[np.float64]:
    """Integral of the radiance over a cone [W m⁻²], texel by texel; shape (3,).

    Parameters
    ----------
    image : ndarray, shape (H, W, 3)
        Latitude–longitude map.
    direction : array_like, shape (3,)
        Unit axis of the cone.
    half_angle : float
        Of the cone [rad]; texels whose centre lies inside count.
    """
    height, width = image.shape[:2]
    inside = texel_centres(height, width) @ np.asarray(direction, dtype=np.float64) > np.cos(half_angle)
    return np.asarray((image * (inside * hat_integrals(height, width)[:, None])[..., None]).sum(axis=(0, 1)))


def texel_centres(height: int, width: int) -> NDArray[np.float64]:
    """Directions of the texels' centres, shape (H, W, 3)."""
    centres = np.array(texel_directions(MITSUBA, (height, width)), dtype=np.float64)
    return centres.T.reshape(height, width, 3)

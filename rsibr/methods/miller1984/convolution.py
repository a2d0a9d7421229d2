"""Convolution of an illumination table in polar coordinates with a function of the angle: the sum over all its texels.

The sum is the printed one, T[N] = Σ_L I[L] Area[L] f(N·L) / 4π, over every texel and without noise. Between two rows it
is a circular convolution in longitude, and is computed as one (fast Fourier transform): exact to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.latlong import POLAR
from rsibr.geometry.projections.sphere_image import texel_solid_angles
from rsibr.methods.miller1984.reflectance import Reflectance

Array = NDArray[np.float64]


def latitudes(rows: int) -> Array:
    """Polar angles v [rad] of the middles of the rows, from +Y; Miller & Hoffman (1984), section 4.3."""
    return np.asarray((np.arange(rows) + 0.5) * (np.pi / rows))


def texel_areas(rows: int, columns: int) -> Array:
    """Solid angle [sr] of each texel, shape (rows, columns, 1)."""
    return texel_solid_angles(POLAR, (rows, columns))[0, ..., None]


def convolved(illumination: Array, reflectance: Reflectance, rows: int, columns: int) -> Array:
    """Sum of a table over all its texels, (Σ_L I[L] Area[L] f(N·L)) / 4π, without the mirror part of f.

    Parameters
    ----------
    illumination : ndarray, shape (H, W, 3)
        Mean radiance over each texel [W sr⁻¹ m⁻²]: rows by latitude from +Y, columns by longitude.
    reflectance : Reflectance
        The function f.
    rows, columns : int
        Texels of the result. Fastest where `columns` divides W.

    Returns
    -------
    ndarray, shape (rows, columns, 3)
        Reflected radiance for constants k = 1; Miller & Hoffman (1984), section 6.
    """
    height, width, _ = illumination.shape
    table = np.zeros((rows, columns, 3))
    if reflectance.values is None:
        return table
    energy = illumination * texel_areas(height, width)
    spectrum = np.fft.rfft(energy, axis=1)
    place = (np.arange(columns) + 0.5) * (width / columns) - 0.5  # of the result's columns, in columns of the light
    whole = np.floor(place + 1e-9)
    offsets = np.round(np.maximum(place - whole, 0), 12)
    for offset in np.unique(offsets):
        chosen = np.flatnonzero(offsets == offset)
        at = whole[chosen].astype(np.intp) % width
        for row in range((rows + 1) // 2):  # a row and its mirror image have the same kernel
            light, kernel = _kernel(reflectance, latitudes(rows)[row], height, width, float(offset))
            for out, used in ((row, light), (rows - 1 - row, height - 1 - light)):
                around = np.einsum("hk,hkc->kc", kernel, spectrum[used])
                table[out, chosen] = np.fft.irfft(around, n=width, axis=0)[at]
    return np.asarray(table / (4 * np.pi))


def _kernel(
    reflectance: Reflectance, latitude: float, height: int, width: int, offset: float
) -> tuple[NDArray[np.intp], NDArray[np.complex128]]:
    """Rows of the light that a latitude sees, and for each the spectrum of f over the difference of longitudes."""
    assert reflectance.values is not None
    v = latitudes(height)
    light = np.flatnonzero(np.cos(v - latitude) > reflectance.least)
    is_even = offset in (0.0, 0.5)  # then f at one difference is f at its negative, and half of them suffice
    turn = (np.arange(width // 2 + 1 if is_even else width) + offset) * (2 * np.pi / width)
    across, along = np.cos(latitude) * np.cos(v[light, None]), np.sin(latitude) * np.sin(v[light, None])
    cosine = np.minimum(across + along * np.cos(turn), 1.0)
    seen = cosine > reflectance.least
    values = np.zeros_like(cosine)
    values[seen] = reflectance.values(cosine[seen])
    if is_even:
        beyond = np.arange(width // 2 + 1, width)
        values = np.concatenate([values, values[:, (-beyond - round(2 * offset)) % width]], axis=1)
    return light, np.fft.rfft(values, axis=1)

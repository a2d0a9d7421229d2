"""Spherical harmonics of a latitude–longitude map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import sph_legendre_p_all

LMAX = 32
"""Highest band: features of about 6°."""

_ROWS, _COLUMNS = 128, 256


def coefficients(image: NDArray[np.float64], lmax: int = LMAX) -> NDArray[np.complex128]:
    """Coefficients a_lm = ∫ L Y*_lm dω of a real map.

    Parameters
    ----------
    image : ndarray, shape (H, W)
        Rows at polar angles j π / (H − 1) from +Y, columns evenly spaced in azimuth.
    lmax : int
        Highest band.

    Returns
    -------
    ndarray, shape (lmax + 1, lmax + 1), complex
        a_lm for m ≥ 0, orthonormal harmonics; a_l,−m = (−1)^m a*_lm.
    """
    grid = reduced(image[..., None], _ROWS, _COLUMNS)[..., 0] if image.size > _ROWS * _COLUMNS else image
    rows, columns = grid.shape
    legendre = _legendre(rows, lmax)
    around = np.fft.rfft(grid, axis=1) * (2 * np.pi / columns)
    orders = np.zeros((rows, lmax + 1), dtype=np.complex128)
    orders[:, : min(lmax + 1, around.shape[1])] = around[:, : lmax + 1]
    return np.asarray(np.einsum("lmh,h,hm->lm", legendre, _polar_weights(rows), orders))


def synthesis(spectrum: NDArray[np.complex128], rows: int = _ROWS, columns: int = _COLUMNS) -> NDArray[np.float64]:
    """Map of shape (rows, columns) with these coefficients: the inverse of `coefficients`."""
    lmax = len(spectrum) - 1
    orders = np.einsum("lmh,lm->hm", _legendre(rows, lmax), spectrum)
    around = np.zeros((rows, columns // 2 + 1), dtype=np.complex128)
    around[:, : lmax + 1] = orders[:, : columns // 2 + 1]
    return np.asarray(np.fft.irfft(around * columns, n=columns, axis=1))


def band_power(spectrum: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Mean square over the sphere of each band, shape (lmax + 1,); the sum is ⟨L²⟩."""
    both = np.where(np.arange(spectrum.shape[1]) == 0, 1.0, 2.0)
    return np.asarray((np.abs(spectrum) ** 2 * both).sum(axis=1) / (4 * np.pi))


def reduced(image: NDArray[np.floating], rows: int, columns: int) -> NDArray[np.float64]:
    """Box-filter a map (H, W, C) down to at most `rows` × `columns`; its first and last row stay on the poles."""
    smaller = _averaged(image, min(rows, image.shape[0]), on_ends=True)
    turned = np.swapaxes(smaller, 0, 1)
    return np.ascontiguousarray(np.swapaxes(_averaged(turned, min(columns, len(turned)), on_ends=False), 0, 1))


def _averaged(image: NDArray[np.floating], count: int, on_ends: bool) -> NDArray[np.float64]:
    """Means over `count` intervals of the first axis; with `on_ends`, its outer samples lie on the ends of the axis."""
    length = len(image)
    if length in (1, count):
        return np.asarray(image, dtype=np.float64)
    # Differences of the cumulative integral of a piecewise constant signal at the intervals' borders
    edges = (np.arange(count + 1) - 0.5) / (count - 1) * (length - 1) + 0.5 if on_ends else None
    borders = np.clip(np.arange(count + 1) * (length / count) if edges is None else edges, 0, length)
    integral = np.concatenate([np.zeros((1, *image.shape[1:])), np.cumsum(image, axis=0, dtype=np.float64)])
    below = np.minimum(borders.astype(int), length - 1)
    part = (borders - below).reshape(-1, *[1] * (image.ndim - 1))
    at = integral[below] + part * (integral[below + 1] - integral[below])
    return np.asarray(np.diff(at, axis=0) / np.diff(borders).reshape(-1, *[1] * (image.ndim - 1)))


def _polar_weights(rows: int) -> NDArray[np.float64]:
    """Quadrature weights of ∫ f sin θ dθ over rows that include both poles (Clenshaw & Curtis 1960).

    Exact for trigonometric polynomials up to degree rows − 1, so that bands do not mix.
    """
    if rows < 3:
        return np.full(rows, 2.0 / rows)
    n = rows - 1
    k = np.arange(0, n + 1, 2)
    moments = 2.0 / (1.0 - k**2)  # ∫ cos kθ sin θ dθ
    factors = np.where((k == 0) | (k == n), 0.5, 1.0) * moments
    weights = 2.0 / n * np.cos(np.outer(np.arange(rows), k) * np.pi / n) @ factors
    weights[[0, -1]] /= 2
    return np.asarray(weights)


def _legendre(rows: int, lmax: int) -> NDArray[np.float64]:
    """Orthonormal associated Legendre functions, shape (lmax + 1, lmax + 1, rows), at the rows' polar angles."""
    polar = np.linspace(0, np.pi, rows)
    return np.asarray(sph_legendre_p_all(lmax, lmax, polar)[0][:, : lmax + 1])

"""Noise of residuals, taken out where it outweighs them.

A stored map is a Monte Carlo estimate with a known variance. Where the prediction is good, the residual is mostly the
noise of the map, and carrying it to a new view would add that noise. The residual is split into scales, and each scale
is attenuated by the share of its local energy that the noise explains.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, distance_transform_edt

Array = NDArray[np.float64]

SCALES = 5
"""Scales of the decomposition; the coarsest detail is 2^SCALES texels wide."""

_SPLINE = np.array([1, 4, 6, 4, 1]) / 16  # cubic B-spline
_AROUND = 2.0  # width of the neighbourhood of a local energy, in spacings of the scale


def denoised(residual: NDArray[np.float32], variance: NDArray[np.float32], covered: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Attenuate the noise of a residual map.

    Parameters
    ----------
    residual : ndarray, shape (N, N, 3)
        Residuals [W sr⁻¹ m⁻²].
    variance : ndarray, shape (N, N, 3)
        Their variance.
    covered : ndarray, shape (N, N)
        Texels that hold a value.

    Returns
    -------
    ndarray, shape (N, N, 3)

    Notes
    -----
    À-trous wavelets with a cubic B-spline (Starck & Murtagh 1994); in each, the empirical Wiener filter
    max(e² − s², 0)/e² with the local energy e² and that of the noise, s².
    """
    row, column = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    smooth, noise = residual[row, column].astype(np.float64), variance[row, column].astype(np.float64)
    result = np.zeros_like(smooth)
    kernel = np.ones((1, 1))
    for scale in range(SCALES):
        coarser = _blurred(smooth, 2**scale)
        detail = smooth - coarser
        # Noise of this detail: white noise through the difference of two kernels
        wider = _kernel_blurred(kernel, 2**scale)
        share = float(((np.pad(kernel, (len(wider) - len(kernel)) // 2) - wider) ** 2).sum())
        energy, expected = _blurred(detail**2, 2**scale), share * _blurred(noise, 2**scale)
        result += detail * np.maximum(energy - expected, 0) / np.maximum(energy, 1e-30)
        smooth, kernel = coarser, wider
    energy, expected = smooth**2, float((kernel**2).sum()) * _blurred(noise, 2**SCALES)
    result += smooth * np.maximum(energy - expected, 0) / np.maximum(energy, 1e-30)
    return np.asarray(result, dtype=np.float32)


def _blurred(values: Array, step: int) -> Array:
    kernel = _spread(step)
    return np.asarray(convolve1d(convolve1d(values, kernel, axis=0, mode="nearest"), kernel, axis=1, mode="nearest"))


def _kernel_blurred(kernel: Array, step: int) -> Array:
    padded = np.pad(kernel, 2 * step)
    spread = _spread(step)
    return np.asarray(convolve1d(convolve1d(padded, spread, axis=0, mode="constant"), spread, axis=1, mode="constant"))


def _spread(step: int) -> Array:
    """Taps of the spline, `step` texels apart."""
    kernel = np.zeros(4 * step + 1)
    kernel[::step] = _SPLINE
    return kernel

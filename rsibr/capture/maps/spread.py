"""Variance of pixels of which no noise is known: their differences from a smooth picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve, uniform_filter

_SECOND_DIFFERENCE = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
"""Immerkær (1996): blind to a plane and to edges along an axis; its noise gain is 36."""

_WINDOW = 7


def pixel_variance(radiance: NDArray[np.floating]) -> NDArray[np.float32]:
    """Variance of each pixel from the spread of its neighbourhood; fine detail counts as noise: an upper bound.

    Parameters
    ----------
    radiance : ndarray, shape (H, W, 3)

    Returns
    -------
    ndarray, shape (H, W, 3), float32
        Mean over 7 × 7 pixels of the squared second difference, which of independent noise has 36 times its variance.

    Notes
    -----
    J. Immerkær, *Fast noise variance estimation*, Computer Vision and Image Understanding 64 (1996).
    """
    rough = convolve(radiance.astype(np.float64), _SECOND_DIFFERENCE[..., None], mode="nearest") ** 2 / 36
    return np.asarray(uniform_filter(rough, (_WINDOW, _WINDOW, 1), mode="nearest"), dtype=np.float32)

"""Noise of a map as relMSE: variance relative to the squared radiance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.store.map_file import MapFile

COVERED = 0.5
"""Least coverage of the texels that are evaluated."""

_SOFTENING = 0.1
_DARKEST_CHANNEL = 1e-4
_TINY = float(np.finfo(np.float32).tiny) ** 2

Array = NDArray[np.float64]


def denominator(b: Array) -> Array:
    """Denominator of relMSE: b² + ε with ε = (0.1·mean b)², per channel.

    Parameters
    ----------
    b : ndarray, shape (T, 3)
        Radiance of the reference in the evaluated texels.

    Notes
    -----
    The mean of a channel is at least 1e-4 of the mean of all three, so that rounding in an almost black channel does
    not dominate. The smallest normal float32, squared, avoids division by zero for a black reference.
    """
    mean = np.abs(b.mean(axis=0))
    softening = _SOFTENING * np.maximum(mean, _DARKEST_CHANNEL * mean.mean())
    return np.asarray(b**2 + softening**2 + _TINY)


def relative_variance(mean: Array, variance: Array) -> Array:
    """Variance relative to the squared radiance, mean over the channels.

    Parameters
    ----------
    mean, variance : ndarray, shape (T, 3)
        Radiance and its variance in the evaluated texels of one map.

    Returns
    -------
    ndarray, shape (T,)
        Relative variance; its mean over the texels is the relMSE due to noise.
    """
    return np.asarray((variance / denominator(mean)).mean(axis=1))


def map_noise(map_file: MapFile) -> float:
    """RelMSE due to the noise of a map, from its variance; NaN if an evaluated texel is not finite."""
    if map_file.variance is None:
        raise ValueError("the variance of the map is not known")
    judged = map_file.coverage >= COVERED
    mean, variance = (image[judged].astype(np.float64) for image in (map_file.radiance, map_file.variance))
    return float(relative_variance(mean, variance).mean())

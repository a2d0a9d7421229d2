"""The noise of a map on the scale of its error: variance relative to the squared radiance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.store.map_file import MapFile

COVERED = 0.5
"""Texels of this coverage or more are judged."""

_SOFTENING = 0.1
_DARKEST_CHANNEL = 1e-4
_TINY = float(np.finfo(np.float32).tiny) ** 2

Array = NDArray[np.float64]


def denominator(b: Array) -> Array:
    """b² + ε, with ε = (0.1·mean b)² a channel: what a squared error is relative to.

    Parameters
    ----------
    b : ndarray, shape (T, 3)
        Radiance of the reference in the judged texels.

    Notes
    -----
    A channel darker than 1e-4 of the mean of all three takes that as its mean, lest rounding in a channel that is all
    but black outweighs what can be seen. The least float32 keeps an all-black reference finite.
    """
    mean = np.abs(b.mean(axis=0))
    softening = _SOFTENING * np.maximum(mean, _DARKEST_CHANNEL * mean.mean())
    return np.asarray(b**2 + softening**2 + _TINY)


def relative_variance(mean: Array, variance: Array) -> Array:
    """Variance relative to the squared radiance, mean over the channels.

    Parameters
    ----------
    mean, variance : ndarray, shape (T, 3)
        Of the judged texels of one map.

    Returns
    -------
    ndarray, shape (T,)
        Its mean over the texels is the relMSE that the noise makes.
    """
    return np.asarray((variance / denominator(mean)).mean(axis=1))


def map_noise(map_file: MapFile) -> float:
    """RelMSE that the noise of a stored map makes, from its variance; NaN where a judged texel is not finite."""
    if map_file.variance is None:
        raise ValueError("the variance of the map is not known")
    judged = map_file.coverage >= COVERED
    mean, variance = (image[judged].astype(np.float64) for image in (map_file.radiance, map_file.variance))
    return float(relative_variance(mean, variance).mean())

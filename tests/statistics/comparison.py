"""Tests of a map with known variance against another: each texel, blocks of texels, and all of them together.

A texel's test sees a firefly and is blind to a small bias everywhere; the aggregate sees that and is blind to a bias
that changes its sign over the map; blocks lie between. p-values are float64, from survival functions: never zero by
rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

Array = NDArray[np.float64]

DARKEST = 1e-6
"""Share of the mean radiance below which a difference is rounding."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Smallest p-value of each test, corrected for how many there were (Šidák), and the picture of the texels' own.

    Attributes
    ----------
    texel, block, aggregate : float
        Corrected p-values: each is uniform in [0, 1], or larger, where the two maps have the same mean.
    p_values : ndarray, shape (H, W)
        Of each texel, smallest of the channels, not corrected; 1 where nothing is judged.
    """

    texel: float
    block: float
    aggregate: float
    p_values: Array


def compared(a: Array, variance_a: Array, b: Array, variance_b: Array, judged: NDArray, freedom: float) -> Comparison:
    """Compare two maps of independent noise.

    Parameters
    ----------
    a, b : ndarray, shape (H, W, 3)
        The maps; H and W multiples of four.
    variance_a, variance_b : ndarray, shape (H, W, 3)
        Estimated variances of their texels.
    judged : ndarray of bool, shape (H, W)
    freedom : float
        Degrees of freedom of the poorer variance: Welch's t with these is conservative.
    """
    difference = np.where(judged[..., None], a.astype(np.float64) - b, 0.0)
    variance = variance_a.astype(np.float64) + variance_b + (DARKEST * np.abs(b[judged]).mean()) ** 2
    variance = np.where(judged[..., None], variance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(judged[..., None], difference / np.sqrt(variance), 0.0)
    p_values = 2 * student.sf(np.abs(t), freedom)
    return Comparison(
        texel=sidak(p_values[judged]),
        block=_blocks(difference, variance, freedom),
        aggregate=_aggregate(t[judged]),
        p_values=p_values.min(axis=-1),
    )


def sidak(p_values: Array) -> float:
    """Smallest p-value, corrected for their count: 1 − (1 − p)^n, without loss where p is tiny."""
    return float(-np.expm1(p_values.size * np.log1p(-min(float(p_values.min()), 1 - 1e-16))))


def _blocks(difference: Array, variance: Array, freedom: float) -> float:
    """Sums over blocks of 4 × 4 texels against the sums of their variances, a channel each."""
    shape = (difference.shape[0] // 4, 4, difference.shape[1] // 4, 4, 3)
    sums, variances = (image.reshape(shape).sum(axis=(1, 3)) for image in (difference, variance))
    used = variances > 0
    # The summed variance has more degrees of freedom than a single one: the latter are conservative.
    return sidak(2 * student.sf(np.abs(sums[used]) / np.sqrt(variances[used]), freedom))


def _aggregate(t: Array) -> float:
    """Mean of all t-values against their own spread; the channels share their samples: one number a texel."""
    texels = t.mean(axis=1)
    return float(2 * norm.sf(abs(texels.sum()) / np.sqrt((texels**2).sum())))

"""Adaptive sample allocation: more blocks for the texels and views that contribute more noise to the relMSE.

The relMSE of a map is the mean over its texels of r²/k, where k is the number of blocks and r the standard deviation of
one block relative to the radiance. For a given total number of blocks it is minimal for k proportional to r: Neyman
(1934), *On the Two Different Aspects of the Representative Method*, section V.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

LEAST_SHARE = 0.5
"""Minimum blocks of a texel over those of uniform allocation. Protects texels whose noise the pilot underestimated, and
keeps enough degrees of freedom for the variance."""

MOST_SHARE = 8.0
"""Maximum blocks of a texel over those of uniform allocation."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Allocation:
    """Number of blocks of a texel as a function of its noise.

    Attributes
    ----------
    even : int
        Blocks a texel of uniform allocation.
    scale : float or None
        Blocks over the relative standard deviation of a block; None: uniform allocation.
    """

    even: int
    scale: float | None = None

    def shares(self, spread: Array) -> Array:
        """Blocks of each texel before rounding.

        Parameters
        ----------
        spread : ndarray
            Relative standard deviation of a block of each texel.
        """
        if self.scale is None:
            return np.full(spread.shape, float(self.even))
        return np.clip(self.scale * spread, LEAST_SHARE * self.even, MOST_SHARE * self.even)

    def counts(self, spread: Array) -> NDArray[np.int64]:
        """Blocks of each texel."""
        return np.rint(self.shares(spread)).astype(np.int64)

    def noise(self, spread: Array) -> float:
        """Predicted relMSE of the noise, from the relative standard deviation of a block of each texel."""
        return float((spread**2 / self.shares(spread)).mean())


def equal_work(even: int, spread: Array) -> Allocation:
    """Adaptive allocation with the same total number of blocks as a uniform one.

    Parameters
    ----------
    even : int
        Blocks a texel of uniform allocation.
    spread : ndarray
        Relative standard deviation of a block, for texels of all views; not all zero.
    """

    def surplus(logarithm: float) -> float:
        return float(Allocation(even, math.exp(logarithm)).shares(spread).mean()) - even

    typical = math.log(even / float(spread.mean()))
    reach = math.log(MOST_SHARE / LEAST_SHARE) + math.log(spread.max() / spread[spread > 0].min()) + 1
    if surplus(typical + reach) <= 0:  # nearly all texels are free of noise: the others are at the maximum
        return Allocation(even, math.exp(typical + reach))
    return Allocation(even, math.exp(brentq(surplus, typical - reach, typical + reach, xtol=1e-6)))

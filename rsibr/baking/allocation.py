"""Where samples are spent: more blocks for the texels and views whose noise weighs more in relMSE.

The relMSE of a map is the mean over its texels of r²/k, where k is the count of blocks and r the standard deviation of
one of them relative to the radiance. For a given sum of all k it is least for k proportional to r: Neyman (1934), *On
the Two Different Aspects of the Representative Method*, section V.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

LEAST_SHARE = 0.5
"""Blocks of any texel, to those of the even share: one that the pilot found too quiet is not starved, and its variance
keeps its degrees of freedom."""

MOST_SHARE = 8.0
"""Blocks of any texel, to those of the even share."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Allocation:
    """How many blocks a texel gets, by its spread.

    Attributes
    ----------
    even : int
        Blocks of the even share.
    scale : float or None
        Blocks to the relative standard deviation of a block; None: every texel gets the even share.
    """

    even: int
    scale: float | None = None

    def shares(self, spread: Array) -> Array:
        """Blocks of each texel before they are rounded to whole ones.

        Parameters
        ----------
        spread : ndarray
            Relative standard deviation of a block.
        """
        if self.scale is None:
            return np.full(spread.shape, float(self.even))
        return np.clip(self.scale * spread, LEAST_SHARE * self.even, MOST_SHARE * self.even)

    def counts(self, spread: Array) -> NDArray[np.int64]:
        """Blocks of each texel."""
        return np.rint(self.shares(spread)).astype(np.int64)

    def noise(self, spread: Array) -> float:
        """RelMSE that the noise makes, by the spread of the texels."""
        return float((spread**2 / self.shares(spread)).mean())


def equal_work(even: int, spread: Array) -> Allocation:
    """Allocation by the spread that takes as many blocks in all as an even one.

    Parameters
    ----------
    even : int
        Blocks of the even share.
    spread : ndarray
        Relative standard deviation of a block, of texels of all views; not all zero.
    """

    def surplus(logarithm: float) -> float:
        return float(Allocation(even, math.exp(logarithm)).shares(spread).mean()) - even

    typical = math.log(even / float(spread.mean()))
    reach = math.log(MOST_SHARE / LEAST_SHARE) + math.log(spread.max() / spread[spread > 0].min()) + 1
    if surplus(typical + reach) <= 0:  # all but a few texels are free of noise: those few have the most there is
        return Allocation(even, math.exp(typical + reach))
    return Allocation(even, math.exp(brentq(surplus, typical - reach, typical + reach, xtol=1e-6)))

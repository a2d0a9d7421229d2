"""Blocks of samples: independent estimates of a texel, whose spread is the variance of their mean."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.bake.integrator import MAX_LANES, stratified

MAX_BLOCKS = 16
"""Blocks a texel where each has as many. Not more, for samples are stratified only within a block."""

LEAST_BLOCK = 4
"""Samples of a block below which there are rather fewer blocks."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """How often each texel of a view is estimated.

    Attributes
    ----------
    size : int
        Samples of a block, stratified among each other.
    counts : int or ndarray of int, shape (covered texels,)
        Blocks of every texel, or of each; at least 2.
    """

    size: int
    counts: int | NDArray[np.int64]

    @property
    def samples(self) -> int:
        """Samples of a block as they are launched: strata have whole rows and columns."""
        return stratified(self.size)

    def launches(self, texels: int) -> Iterator[NDArray[np.int64]]:
        """Which texel each block is for, ascending, a launch at a time."""
        every = np.repeat(np.arange(texels), np.broadcast_to(self.counts, texels))
        step = max(1, MAX_LANES // self.samples)
        for first in range(0, len(every), step):
            yield every[first : first + step]

    def launch_count(self, texels: int) -> int:
        """Count of the launches."""
        total = int(np.broadcast_to(self.counts, texels).sum())
        return math.ceil(total / max(1, MAX_LANES // self.samples))


def block_sizes(samples: int) -> Blocks:
    """Split the samples of each texel into blocks, as many for all.

    Parameters
    ----------
    samples : int
        Samples a texel, at least 2. Rounded up to a multiple of the count of blocks.
    """
    count = max(2, min(MAX_BLOCKS, samples // LEAST_BLOCK))
    return Blocks(-(-samples // count), count)


class BlockSums:
    """Sums over the blocks of each texel, whatever launch they came from.

    Parameters
    ----------
    texels, lobes : int
        Covered texels, and lobes of each.
    """

    def __init__(self, texels: int, lobes: int) -> None:
        self._count = np.zeros((texels, 1))
        self._total = np.zeros((texels, lobes, 3))
        self._squares = np.zeros((texels, 3))

    def add(self, texels: NDArray[np.int64], means: NDArray[np.float32]) -> None:
        """Take in the means of some blocks.

        Parameters
        ----------
        texels : ndarray of int, shape (B,)
            Texel of each block, ascending.
        means : ndarray, shape (B, lobes, 3)
        """
        first = np.flatnonzero(np.diff(texels, prepend=-1))
        where, exact = texels[first], means.astype(np.float64)
        self._count[where] += np.diff(first, append=len(texels))[:, None]
        self._total[where] += np.add.reduceat(exact, first, axis=0)
        # Of float32 values in float64: what cancels below lies beneath their own rounding
        self._squares[where] += np.add.reduceat(exact.sum(axis=1) ** 2, first, axis=0)

    def result(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean of the blocks, and the variance of the mean of the summed lobes.

        Returns
        -------
        mean : ndarray, shape (texels, lobes, 3), float32
            Unbiased, for the counts of blocks were fixed before the first of them was seen.
        variance : ndarray, shape (texels, 3), float32
            Its estimate has (blocks − 1) degrees of freedom.
        """
        mean = self._total / self._count[..., None]
        spread = np.maximum(self._squares / self._count - mean.sum(axis=1) ** 2, 0.0)  # keeps a NaN
        variance = spread / (self._count - 1)
        return mean.astype(np.float32), variance.astype(np.float32)

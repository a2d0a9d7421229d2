"""Blocks of samples: independent estimates of a texel, whose spread is the variance of their mean."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.baking.integrator import MAX_LANES, Launch, SphereIntegrator
from rsibr.baking.lattice import MAX_POINTS

MAX_BLOCKS = 8
"""Blocks a texel where each has as many. Not more, for samples are spread evenly only within a block."""

LEAST_BLOCK = 4
"""Samples of a block below which there are rather fewer blocks."""

FEW_BLOCKS = 3
"""Blocks a texel where their size is free: fine lattices, and a spread of two degrees of freedom."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """How often each texel of a view is estimated.

    Attributes
    ----------
    size : int
        Samples of a block, spread evenly among each other; at most `MAX_POINTS`.
    counts : int or ndarray of int, shape (covered texels,)
        Blocks of every texel, or of each; at least 2.
    """

    size: int
    counts: int | NDArray[np.int64]

    def launches(self, texels: int, max_lanes: int = MAX_LANES) -> Iterator[NDArray[np.int64]]:
        """Which texel each block is for, ascending, a launch of at most `max_lanes` samples at a time."""
        every = np.repeat(np.arange(texels), np.broadcast_to(self.counts, texels))
        step = max(1, max_lanes // self.size)
        for first in range(0, len(every), step):
            yield every[first : first + step]

    def launch_count(self, texels: int, max_lanes: int = MAX_LANES) -> int:
        """Count of the launches."""
        total = int(np.broadcast_to(self.counts, texels).sum())
        return math.ceil(total / max(1, max_lanes // self.size))


def block_sizes(samples: int) -> Blocks:
    """Split the samples of each texel into blocks, as many for all.

    Parameters
    ----------
    samples : int
        Samples a texel, at least 2. Rounded up to a multiple of the count of blocks.
    """
    count = max(2, min(MAX_BLOCKS, samples // LEAST_BLOCK), -(-samples // MAX_POINTS))
    return Blocks(-(-samples // count), count)


class BlockSums:
    """Sums over the blocks of each texel, whatever launch they came from.

    Parameters
    ----------
    texels, lobes : int
        Covered texels, and lobes of each.
    """

    def __init__(self, texels: int, lobes: int) -> None:
        self._count = np.zeros(texels)
        self._total = np.zeros((lobes, 3, texels))
        self._squares = np.zeros((3, texels))

    def add(self, texels: NDArray[np.int64], means: NDArray[np.float32]) -> None:
        """Take in the means of some blocks.

        Parameters
        ----------
        texels : ndarray of int, shape (B,)
            Texel of each block, ascending.
        means : ndarray, shape (B, lobes, 3)
        """
        first = np.flatnonzero(np.diff(texels, prepend=-1))
        where, by_channel = texels[first], means.transpose(1, 2, 0)  # as it lies in memory
        self._count[where] += np.diff(first, append=len(texels))
        self._total[..., where] += np.add.reduceat(by_channel, first, axis=-1, dtype=np.float64)
        # Of float32 values in float64: what cancels below lies beneath their own rounding
        squares = by_channel.sum(axis=0, dtype=np.float64) ** 2
        self._squares[:, where] += np.add.reduceat(squares, first, axis=-1)

    def result(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean of the blocks, and the variance of the mean of the summed lobes.

        Returns
        -------
        mean : ndarray, shape (texels, lobes, 3), float32
            Unbiased, for the counts of blocks were fixed before the first of them was seen.
        variance : ndarray, shape (texels, 3), float32
            Its estimate has (blocks − 1) degrees of freedom.
        """
        mean = self._total / self._count
        spread = np.maximum(self._squares / self._count - mean.sum(axis=0) ** 2, 0.0)  # keeps a NaN
        variance = spread / (self._count - 1)
        return mean.astype(np.float32).transpose(2, 0, 1), variance.astype(np.float32).T


def estimate(
    integrator: SphereIntegrator,
    frame: NDArray[np.float64],
    blocks: Blocks,
    seeds: np.random.SeedSequence,
    on_launch: Callable[[float], None] = lambda _: None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Estimate all texels of a view, a launch at a time.

    Parameters
    ----------
    integrator : SphereIntegrator
        Scene and resolution.
    frame : ndarray, shape (3, 3)
        Frame of the map.
    blocks : Blocks
        Blocks of each texel, fixed before any of these samples is drawn.
    seeds : SeedSequence
        Fixes every random number.
    on_launch : callable
        Called with the share of the work that is done.

    Returns
    -------
    mean, variance : ndarray
        See `BlockSums.result`.
    """
    covered, most = int(np.count_nonzero(integrator.coverage)), integrator.max_lanes
    count = blocks.launch_count(covered, most)
    sums = BlockSums(covered, len(integrator.lobe_names))

    def launches() -> Iterator[tuple[NDArray[np.int64], Launch]]:
        for texels, seed in zip(blocks.launches(covered, most), seeds.generate_state(count), strict=True):
            yield texels, integrator.launch(frame, texels, blocks.size, int(seed))

    with backend.rendering(integrator.rendering):
        for done, (texels, means) in enumerate(_one_ahead(launches()), start=1):
            sums.add(texels, means)
            on_launch(done / count)
    return sums.result()


def _one_ahead(
    launches: Iterator[tuple[NDArray[np.int64], Launch]],
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float32]]]:
    """Wait for each launch, and begin the next before its means are handed out: the device has no pause."""
    current = next(launches, None)
    while current is not None:
        texels, means = current[0], current[1].means()
        current = next(launches, None)
        yield texels, means

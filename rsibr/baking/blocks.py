"""Blocks of samples: independent estimates of a texel, whose spread gives the variance of their mean."""

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
"""Blocks a texel of uniform allocation. No more, because samples are stratified within a block only."""

LEAST_BLOCK = 4
"""Minimum samples of a block; with fewer samples a texel, the number of blocks is reduced."""

FEW_BLOCKS = 3
"""Blocks a texel where the block size is free: fine lattices, and a variance with two degrees of freedom."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Number and size of the blocks of each texel of a view.

    Attributes
    ----------
    size : int
        Samples a block, stratified among each other; at most `MAX_POINTS`.
    counts : int or ndarray of int, shape (covered texels,)
        Blocks a texel, the same for all or one number for each; at least 2.
    """

    size: int
    counts: int | NDArray[np.int64]

    def launches(self, texels: int, max_lanes: int = MAX_LANES) -> Iterator[NDArray[np.int64]]:
        """Yield the texel of each block, ascending, in launches of at most `max_lanes` samples."""
        every = np.repeat(np.arange(texels), np.broadcast_to(self.counts, texels))
        step = max(1, max_lanes // self.size)
        for first in range(0, len(every), step):
            yield every[first : first + step]

    def launch_count(self, texels: int, max_lanes: int = MAX_LANES) -> int:
        """Number of launches."""
        total = int(np.broadcast_to(self.counts, texels).sum())
        return math.ceil(total / max(1, max_lanes // self.size))


def block_sizes(samples: int) -> Blocks:
    """Split the samples of each texel into blocks, the same number for all texels.

    Parameters
    ----------
    samples : int
        Samples a texel, at least 2. Rounded up to a multiple of the number of blocks.
    """
    count = max(2, min(MAX_BLOCKS, samples // LEAST_BLOCK), -(-samples // MAX_POINTS))
    return Blocks(-(-samples // count), count)


class BlockSums:
    """Sums over the blocks of each texel, across launches.

    Parameters
    ----------
    texels, lobes : int
        Number of covered texels, and of lobes.
    """

    def __init__(self, texels: int, lobes: int) -> None:
        self._count = np.zeros(texels)
        self._total = np.zeros((lobes, 3, texels))
        self._squares = np.zeros((3, texels))

    def add(self, texels: NDArray[np.int64], means: NDArray[np.float32]) -> None:
        """Add the means of some blocks.

        Parameters
        ----------
        texels : ndarray of int, shape (B,)
            Texel of each block, ascending.
        means : ndarray, shape (B, lobes, 3)
            Mean radiance of each block [W sr⁻¹ m⁻²].
        """
        first = np.flatnonzero(np.diff(texels, prepend=-1))
        where, by_channel = texels[first], means.transpose(1, 2, 0)  # the order in memory
        self._count[where] += np.diff(first, append=len(texels))
        self._total[..., where] += np.add.reduceat(by_channel, first, axis=-1, dtype=np.float64)
        # float64 sums of float32 values: the cancellation in `result` is below the rounding of the values
        squares = by_channel.sum(axis=0, dtype=np.float64) ** 2
        self._squares[:, where] += np.add.reduceat(squares, first, axis=-1)

    def result(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean over the blocks, and variance of the mean of the sum of lobes.

        Returns
        -------
        mean : ndarray, shape (texels, lobes, 3), float32
            Unbiased, because the numbers of blocks were fixed before the first block was rendered.
        variance : ndarray, shape (texels, 3), float32
            Estimate with (blocks − 1) degrees of freedom.
        """
        mean = self._total / self._count
        spread = np.maximum(self._squares / self._count - mean.sum(axis=0) ** 2, 0.0)  # np.maximum propagates NaN
        variance = spread / (self._count - 1)
        return mean.astype(np.float32).transpose(2, 0, 1), variance.astype(np.float32).T


def estimate(
    integrator: SphereIntegrator,
    frame: NDArray[np.float64],
    blocks: Blocks,
    seeds: np.random.SeedSequence,
    on_launch: Callable[[float], None] = lambda _: None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Estimate all texels of a view, one launch at a time.

    Parameters
    ----------
    integrator : SphereIntegrator
        Scene and resolution.
    frame : ndarray, shape (3, 3)
        Frame of the map, columns x, y, v.
    blocks : Blocks
        Blocks of each texel, fixed before any of these samples is drawn.
    seeds : SeedSequence
        Determines all random numbers.
    on_launch : callable
        Called with the fraction of the work done.

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
    """Yield the means of each launch, with the next launch started before, so that the device is never idle."""
    current = next(launches, None)
    while current is not None:
        texels, means = current[0], current[1].means()
        current = next(launches, None)
        yield texels, means

"""Noise of maps before they are baked, measured on a subset of their own texels.

A promise needs the noise of the very texels that are judged: their size, their share of the rim, their lattices. Maps
of fewer and larger texels overestimate it, the more the sharper the light. Samples of the pilot are discarded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.baking.blocks import Blocks, BlockSums
from rsibr.baking.integrator import SphereIntegrator
from rsibr.store.noise import COVERED, relative_variance

BLOCKS = 4
"""Blocks a texel of the subset."""

LEAST_TEXELS = 2048
"""Texels of all views together in the first subset."""

LEAST_A_VIEW = 48
"""Least texels of a view, for the mean radiance of its map."""

LARGEST_ERROR = 0.04
"""Relative standard error of the noise above which more texels are measured."""

MOST = 0.25
"""Maximum share of the texels that is measured, in maps with more than a few."""

FEW_TEXELS = 4096
"""Texels of all views together up to which all may be measured: a small sun in one mirror map lights few of them."""

_BRANCH = 0x7465_7870
"""Branch of a view's seeds (the letters "texp")."""


@dataclass(frozen=True, eq=False)
class TexelNoise:
    """Noise of a block in a subset of the judged texels, the same number from each view.

    Attributes
    ----------
    texels : list of ndarray of int, shape (M,)
        Of each view: indices among the covered texels.
    variance : ndarray, shape (views, M)
        Relative variance of a block; see `rsibr.store.noise.relative_variance`.
    """

    texels: list[NDArray[np.int64]]
    variance: NDArray[np.float64]

    def mean(self, blocks: NDArray[np.float64] | float = 1.0) -> float:
        """RelMSE of the maps, for the number of blocks of each texel."""
        return float((self.variance / blocks).mean())

    @property
    def error(self) -> float:
        """Relative standard error of `mean`, by the scatter over the texels."""
        mean = float(self.variance.mean())
        return float(self.variance.std()) / math.sqrt(self.variance.size) / mean if mean > 0 else 0.0


@dataclass(eq=False)
class TexelPilot:
    """Measure the noise of views on a subset of their texels; a pure function of scene, views and seed.

    Attributes
    ----------
    integrator : SphereIntegrator
        Integrator of the bake.
    frames : sequence of ndarray, shape (3, 3)
        Frames of all views.
    seed : int
        Root of the seed tree.
    """

    integrator: SphereIntegrator
    frames: Sequence[NDArray[np.float64]]
    seed: int

    def __post_init__(self) -> None:
        coverage = self.integrator.coverage
        self._judged = np.flatnonzero(coverage[coverage > 0] >= COVERED)
        most = max(LEAST_A_VIEW, math.ceil(MOST * len(self._judged)), FEW_TEXELS // len(self.frames))
        self._most = min(len(self._judged), most)
        self._count = min(self._most, max(LEAST_A_VIEW, -(-LEAST_TEXELS // len(self.frames))))

    def look(self, size: int) -> TexelNoise:
        """Relative variance of blocks of `size` samples, in more texels if its mean is uncertain.

        Parameters
        ----------
        size : int
            Samples a block.
        """
        while True:
            found = self._measured(size)
            if found.error <= LARGEST_ERROR or self._count == self._most:
                return found
            self._count = min(self._most, math.ceil(self._count * max(1.5, (found.error / LARGEST_ERROR) ** 2)))

    def _measured(self, size: int) -> TexelNoise:
        with backend.rendering(self.integrator.rendering):
            rows = [self._view(index, frame, size) for index, frame in enumerate(self.frames)]
        return TexelNoise([texels for texels, _ in rows], np.array([variance for _, variance in rows]))

    def _view(self, index: int, frame: NDArray[np.float64], size: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        seeds = np.random.SeedSequence(self.seed, spawn_key=(index, _BRANCH, size, self._count))
        texels = self._subset(np.random.default_rng(seeds))
        blocks, sums = Blocks(size, BLOCKS), BlockSums(len(texels), len(self.integrator.lobe_names))
        most = self.integrator.max_lanes
        states = seeds.generate_state(blocks.launch_count(len(texels), most))
        for where, seed in zip(blocks.launches(len(texels), most), states, strict=True):
            sums.add(where, self.integrator.launch(frame, texels[where], size, int(seed)).means())
        lobes, variance = sums.result()
        mean = lobes.sum(axis=1, dtype=np.float64)
        return texels, relative_variance(mean, variance.astype(np.float64) * BLOCKS)

    def _subset(self, generator: np.random.Generator) -> NDArray[np.int64]:
        """Judged texels spread evenly in scan order, one at random of each stretch."""
        edges = np.linspace(0, len(self._judged), self._count + 1).astype(np.int64)
        place = edges[:-1] + (generator.random(self._count) * np.diff(edges)).astype(np.int64)
        return self._judged[place]

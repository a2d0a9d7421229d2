"""Noise pilot of each view: variance of its texels from a few samples of a small map, which are then discarded.

Samples that steer the allocation must not enter the result, which would be biased: a texel whose first samples missed
a bright spot would be taken for one with little noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, uniform_filter

from rsibr.baking.blocks import Blocks, estimate
from rsibr.baking.integrator import SphereIntegrator
from rsibr.store.noise import COVERED, relative_variance

PILOT_BLOCKS = 4
"""Blocks a texel of the small map. Pooled with its neighbours over three channels, 9 × 3 times as many."""

_COARSER = 4
"""Resolution of the map over that of the pilot: the pilot costs PILOT_BLOCKS / _COARSER² blocks a texel of the map."""

LEAST_SIDE = 16
"""Minimum texels a side of the pilot."""

_POOLED = 3
_PILOT_BRANCH = 0x70696C6F
"""Branch of a view's seeds (the letters "pilo")."""

Image = NDArray[np.float64]


class NoisePilot:
    """Estimate the noise of views before they are baked; a pure function of scene, view and seed.

    Parameters
    ----------
    integrator : SphereIntegrator
        Integrator of the bake.
    size : int
        Samples a block of the bake; the gain of stratification depends on it.
    seed : int
        Root of the seed tree.

    Attributes
    ----------
    size : int
        As given.
    """

    def __init__(self, integrator: SphereIntegrator, size: int, seed: int) -> None:
        side = min(integrator.coverage.shape[0], max(LEAST_SIDE, integrator.coverage.shape[0] // _COARSER))
        self._full, self._small = integrator, integrator.at_resolution(side)
        self.size, self._blocks, self._seed = size, Blocks(size, PILOT_BLOCKS), seed
        covered = self._small.coverage > 0
        self._weight = uniform_filter(covered.astype(np.float64), _POOLED, mode="constant")

    def look(self, frame: NDArray[np.float64], index: int) -> Image:
        """Relative variance of a block for each texel of the small map, pooled with its neighbours.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Frame of the view, columns x, y, v.
        index : int
            Branch of the view in the seed tree.

        Returns
        -------
        ndarray, shape (side, side)
            0 outside the disk.
        """
        covered = self._small.coverage > 0
        seeds = np.random.SeedSequence(self._seed, spawn_key=(index, _PILOT_BRANCH))
        lobes, variance = estimate(self._small, frame, self._blocks, seeds)
        found = np.zeros(covered.shape)
        mean = lobes.sum(axis=1, dtype=np.float64)
        found[covered] = relative_variance(mean, variance.astype(np.float64) * PILOT_BLOCKS)
        pooled = np.maximum(uniform_filter(np.nan_to_num(found, posinf=0.0), _POOLED, mode="constant"), 0.0)
        return np.asarray(np.where(covered, pooled / np.maximum(self._weight, 1e-9), 0.0))

    def spread(self, looked: Image) -> NDArray[np.float64]:
        """Relative standard deviation of a block for the texels of the small map that metrics use, flat."""
        return np.asarray(np.sqrt(looked[self._small.coverage >= COVERED]))

    def enlarged(self, looked: Image) -> NDArray[np.float64]:
        """Relative standard deviation of a block for each covered texel of the bake's maps, interpolated, flat."""
        size, small = self._full.coverage.shape[0], len(looked)
        at = (np.arange(size) + 0.5) * small / size - 0.5
        grid = np.meshgrid(at, at, indexing="ij")
        inside = (self._small.coverage > 0).astype(np.float64)
        weight = map_coordinates(inside, grid, order=1, mode="nearest")
        value = map_coordinates(looked * inside, grid, order=1, mode="nearest")
        variance = np.where(weight > 0, value / np.maximum(weight, 1e-9), 0.0)
        return np.asarray(np.sqrt(variance[self._full.coverage > 0]))

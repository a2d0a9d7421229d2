"""Grid of directions, smoothing on it, and lookups between its nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

_REACH = 2.5  # standard deviations at which the kernel ends


@dataclass(frozen=True, eq=False)
class SphereGrid:
    """Latitude–longitude grid, rows and columns centred.

    Attributes
    ----------
    height : int
        Rows; twice as many columns.
    directions : ndarray, shape (K, 3)
        Unit vectors, row by row from +Y.
    areas : ndarray, shape (K,)
        Solid angles up to a constant.
    """

    height: int
    directions: Array
    areas: Array

    @classmethod
    def of(cls, height: int) -> SphereGrid:
        """Make the grid of so many rows."""
        theta = (np.arange(height) + 0.5) * np.pi / height
        phi = (np.arange(2 * height) + 0.5) * np.pi / height
        sine = np.repeat(np.sin(theta), 2 * height)
        around = np.tile(phi, height)
        up = np.repeat(np.cos(theta), 2 * height)
        return cls(height, np.stack([sine * np.cos(around), up, sine * np.sin(around)], axis=1), sine)

    def lookup(self, field: Array, directions: Array) -> Array:
        """Bilinear lookup of a field, shape (K,), in unit directions, shape (n, 3)."""
        image = field.reshape(self.height, 2 * self.height)
        across = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
        theta = np.arctan2(np.hypot(directions[:, 0], directions[:, 2]), directions[:, 1])
        phi = np.arctan2(directions[:, 2], directions[:, 0]) % (2 * np.pi)
        place = [theta * self.height / np.pi - 0.5, phi * self.height / np.pi + 0.5]
        return np.asarray(map_coordinates(across, place, order=1, mode="nearest"))


@lru_cache(maxsize=4)
def grids() -> tuple[SphereGrid, SphereGrid]:
    """Grid on which maps are compared, every 2.5°, and the finer one on which they are sampled before smoothing."""
    return SphereGrid.of(72), SphereGrid.of(96)


@lru_cache(maxsize=4)
def smoothing(sigma_deg: float) -> csr_array:
    """Gaussian from the finer grid to the coarser one, not normalised: by what is known of the neighbourhood."""
    coarse, fine = grids()
    sigma = np.radians(sigma_deg)
    near = cKDTree(coarse.directions).sparse_distance_matrix(
        cKDTree(fine.directions), _REACH * sigma, output_type="ndarray"
    )
    weights = np.exp(-0.5 * (near["v"] / sigma) ** 2) * fine.areas[near["j"]]
    shape = (len(coarse.directions), len(fine.directions))
    return csr_array((weights, (near["i"], near["j"])), shape=shape)

"""Points of a unit cube that are spread more evenly than random ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sobol(dimensions: int, count: int, seed: int) -> NDArray[np.float64]:
    """Scrambled Sobol points, always the same ones.

    Parameters
    ----------
    dimensions, count : int
        Shape of what is drawn; a count that is a power of two is spread best.
    seed : int
        Of the scrambling.

    Returns
    -------
    ndarray, shape (count, dimensions)
        Points of [0, 1)^dimensions.
    """
    from scipy.stats import qmc  # noqa: PLC0415  # takes half a second, and no mistake in a config has to wait for it

    return np.asarray(qmc.Sobol(dimensions, scramble=True, seed=seed).random(count))

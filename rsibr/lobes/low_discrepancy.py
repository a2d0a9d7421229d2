"""Points of a unit cube that are spread more evenly than random ones."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device

_DEVICE_SEED = 11


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


def device_square(count: int) -> mi.Float:
    """Scrambled Sobol points of the unit square on the device, always the same ones.

    Used at every angle of a table, they leave an error that varies smoothly with the angle.

    Parameters
    ----------
    count : int
        Points; a power of two is spread best.

    Returns
    -------
    mi.Float
        Two floats a point, flat.
    """
    return to_device(mi.Float, sobol(2, count, seed=_DEVICE_SEED).astype(np.float32))

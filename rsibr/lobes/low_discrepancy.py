"""Low-discrepancy points."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device

_DEVICE_SEED = 11


def sobol(dimensions: int, count: int, seed: int) -> NDArray[np.float64]:
    """Scrambled Sobol points of the unit cube, reproducible.

    Parameters
    ----------
    dimensions, count : int
        Dimensions and number of the points; a power of two is best distributed.
    seed : int
        Seed of the scrambling.

    Returns
    -------
    ndarray, shape (count, dimensions)
        Points of [0, 1)^dimensions.
    """
    from scipy.stats import qmc  # noqa: PLC0415  # takes half a second, which errors in a config need not wait for

    return np.asarray(qmc.Sobol(dimensions, scramble=True, seed=seed).random(count))


def device_square(count: int) -> mi.Float:
    """Scrambled Sobol points of the unit square on the device, always the same.

    With the same points at every angle of a table, the quadrature error varies smoothly with the angle.

    Parameters
    ----------
    count : int
        Number of points; a power of two is best distributed.

    Returns
    -------
    mi.Float
        Two floats a point, flat.
    """
    return to_device(mi.Float, sobol(2, count, seed=_DEVICE_SEED).astype(np.float32))

"""Directions that a user gives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError


def unit(direction: ArrayLike, where: str) -> NDArray[np.float64]:
    """Unit vector in a direction of any length but zero, shape (3,).

    Parameters
    ----------
    direction : array_like, shape (3,)
        Finite numbers.
    where : str
        What an error names.

    Raises
    ------
    InputError
        If it is no direction.

    Examples
    --------
    >>> unit((0, 3e300, 4e300), "view").tolist()
    [0.0, 0.6, 0.8]
    """
    vector = np.asarray(direction, dtype=np.float64)
    largest = float(np.abs(vector).max()) if vector.size else 0.0
    if vector.shape != (3,) or not np.isfinite(vector).all() or largest == 0:
        shown = ",".join(f"{value:g}" for value in vector.ravel()[:4])
        raise InputError(f"{shown} is no direction", where=where, fix="give X,Y,Z, not all 0")
    scaled = vector / largest  # first: the square of a huge or tiny component would over- or underflow
    return np.asarray(scaled / np.linalg.norm(scaled))

"""Float16, as GPUs filter it: what it cannot hold is clamped, counted and said."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LARGEST = 65504.0
"""Largest finite float16."""


def to_half(values: NDArray[np.floating]) -> tuple[NDArray[np.float16], tuple[str, ...]]:
    """Round to float16; beyond ±65504 the value nearest to it, not infinity.

    Parameters
    ----------
    values : ndarray
        Finite numbers. Negative ones, which spectral colours outside Rec.709 have, are kept.

    Returns
    -------
    half : ndarray of float16
    notes : tuple of str
        How many values were clamped and how large the largest was; empty if none was.

    Examples
    --------
    >>> half, notes = to_half(np.array([0.5, 1e5, -2.0]))
    >>> half.tolist(), notes
    ([0.5, 65504.0, -2.0], ('1 of 3 values beyond 65504 clamped, up to 1e+05',))
    """
    beyond = np.abs(values) > LARGEST
    half = np.clip(values, -LARGEST, LARGEST).astype(np.float16)
    if not beyond.any():
        return half, ()
    count, largest = int(beyond.sum()), float(np.abs(values).max())
    return half, (f"{count} of {values.size} values beyond 65504 clamped, up to {largest:.3g}",)


def rgba(half: NDArray[np.float16]) -> NDArray[np.float16]:
    """Add the alpha 1 to colours of shape (…, 3)."""
    return np.concatenate([half, np.ones((*half.shape[:-1], 1), np.float16)], axis=-1)

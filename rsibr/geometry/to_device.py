"""Copies of NumPy arrays in memory that Dr.Jit allocates."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray


def to_device(dtype: Any, array: NDArray[Any]) -> Any:
    """Copy a NumPy array to the device.

    Parameters
    ----------
    dtype : type
        Dr.Jit array type, for example `mi.Float`.
    array : ndarray
        Any shape; it is flattened.

    Returns
    -------
    dtype
        Evaluated array in memory allocated by Dr.Jit.

    Notes
    -----
    On the CPU Dr.Jit would borrow NumPy's memory, whose alignment varies from array to array. Kernels are compiled for
    an alignment: the same computation on other data would be compiled again, and packet gathers of whole texels would
    become one gather a channel, at three times the time.
    """
    borrowed = dtype(np.ascontiguousarray(array).ravel())
    own = dr.empty(dtype, len(borrowed))
    dr.scatter(own, borrowed, dr.arange(dr.uint32_array_t(dtype), len(borrowed)))
    dr.eval(own)
    dr.sync_thread()  # wait for the copy: NumPy may free its memory afterwards
    return own

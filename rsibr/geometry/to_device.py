"""Arrays on the device, always laid out alike."""

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
        An evaluated array in memory of Dr.Jit's own.

    Notes
    -----
    On the CPU Dr.Jit would use NumPy's memory as it is, whose alignment differs from array to array. Kernels are
    compiled for it: the same computation on other data would be compiled again, and lookups of whole texels (one
    aligned packet) would fall apart into lookups of each channel, at three times the time.
    """
    borrowed = dtype(np.ascontiguousarray(array).ravel())
    own = dr.empty(dtype, len(borrowed))
    dr.scatter(own, borrowed, dr.arange(dr.uint32_array_t(dtype), len(borrowed)))
    dr.eval(own)
    dr.sync_thread()  # the copy has been made: NumPy may have its memory back
    return own

"""Curve of sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.curves.curve import Curve, register


def _exposure(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """IEC 61966-2-1."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


SRGB = register(Curve.of("srgb", _exposure))
"""IEC 61966-2-1: what a camera's JPEG follows where it has no look of its own."""

"""HDR-FLIP, the perceived difference of two images, at fixed exposures.

By default FLIP derives its exposures from each reference, so that values of different views cannot be compared, and a
black reference has no exposures. Here they are derived once from the mean radiance of the scene.

Andersson, Nilsson, Shirley, Akenine-Möller: *Visualizing Errors in Rendered High Dynamic Range Images* (2021).
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_threads = os.environ.get("OMP_NUM_THREADS")
os.environ["OMP_NUM_THREADS"] = (
    "1"  # read once, when it is loaded: its threads spin, 15 times slower where cores are busy
)
import flip_evaluator  # noqa: E402

if _threads is None:
    del os.environ["OMP_NUM_THREADS"]
else:
    os.environ["OMP_NUM_THREADS"] = _threads

PIXELS_PER_DEGREE = 67.0
"""Default of the authors: a 4K screen 0.7 m wide, seen from 0.7 m."""

_MIDDLE_GREY = 0.18
_STOPS_BELOW = 4
_STOPS_ABOVE = 2
_STOPS_APART = 2


@dataclass(frozen=True)
class Exposures:
    """Exposures [stops] of HDR-FLIP; the difference of a texel is the maximum over them.

    Attributes
    ----------
    start, stop : float
        Lowest exposure, for highlights, and highest exposure, for shadows.
    count : int
        Number of exposures, evenly spaced, both ends included.
    """

    start: float
    stop: float
    count: int

    def to_parameters(self) -> dict[str, float | int | str]:
        """Return the `parameters` of `flip_evaluator.evaluate`."""
        return {
            "startExposure": self.start,
            "stopExposure": self.stop,
            "numExposures": self.count,
            "ppd": PIXELS_PER_DEGREE,
            "tonemapper": "aces",
        }


def exposures_for(mean_radiance: float) -> Exposures:
    """Exposures around the one that maps the mean radiance of the scene to middle grey.

    Parameters
    ----------
    mean_radiance : float
        Mean over the scene [W sr⁻¹ m⁻²], ≥ 0; 0 is treated as 1.

    Returns
    -------
    Exposures
        Four exposures, two stops apart: from four stops below middle grey, which resolves highlights of many times the
        mean, to two stops above it.
    """
    middle = math.log2(_MIDDLE_GREY / (mean_radiance if mean_radiance > 0 else 1.0))
    count = (_STOPS_BELOW + _STOPS_ABOVE) // _STOPS_APART + 1  # each costs 0.1 s at 256²
    return Exposures(middle - _STOPS_BELOW, middle + _STOPS_ABOVE, count)


def flip_map(reference: NDArray[np.floating], test: NDArray[np.floating], exposures: Exposures) -> NDArray[np.float32]:
    """Perceived difference of each texel.

    Parameters
    ----------
    reference, test : ndarray, shape (H, W, 3)
        Scene-linear Rec.709, finite. Negative values are set to 0, as on a screen.
    exposures : Exposures
        See `exposures_for`.

    Returns
    -------
    ndarray, shape (H, W), float32
        Difference in [0, 1]; 0 is no visible difference.

    Raises
    ------
    ValueError
        If a value is NaN or infinite; FLIP itself would ignore it silently.
    """
    pictures = [np.ascontiguousarray(np.maximum(image, 0.0), dtype=np.float32) for image in (reference, test)]
    if not all(np.isfinite(picture).all() for picture in pictures):
        raise ValueError("FLIP is defined for finite radiance only")
    difference, _, _ = flip_evaluator.evaluate(
        *pictures, "HDR", applyMagma=False, computeMeanError=False, parameters=exposures.to_parameters()
    )
    return np.asarray(difference[..., 0], dtype=np.float32)

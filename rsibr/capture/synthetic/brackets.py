"""Exposure brackets of one picture: photographs some stops apart."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.photographs.exposure import Exposure
from rsibr.capture.photographs.photograph import Photograph
from rsibr.capture.synthetic.sensor import Sensor


def bracketed(
    radiance: NDArray[np.floating],
    sensor: Sensor,
    *,
    shots: int = 8,
    stops: float = 2.0,
    longest: Exposure | None = None,
    gain: float = 1.0,
    seed: int = 0,
) -> Iterator[Photograph]:
    """Photograph one picture several times, from the longest exposure to the shortest.

    Parameters
    ----------
    radiance : ndarray, shape (H, W, 3)
        Mean radiance over each pixel.
    sensor : Sensor
        Camera.
    shots : int
        Photographs.
    stops : float
        Stops, factors of two, from one to the next.
    longest : Exposure
        Of the first; one second by default.
    gain : float
        Share of the full well that a radiance of 1 fills in an exposure of amount 1.
    seed : int
        Of the noise.
    """
    first, rng = longest or Exposure(1.0), np.random.default_rng(seed)
    for shot in range(shots):
        exposure = Exposure(first.seconds / 2 ** (stops * shot), first.f_number, first.iso)
        integers = sensor.photographed(radiance, gain * exposure.amount, rng)
        levels = int(np.iinfo(integers.dtype).max)
        values = integers.astype(np.float32) / np.float32(levels)
        yield Photograph(values, levels, False, exposure, f"shot {shot}")

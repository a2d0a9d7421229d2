"""Sensor of a synthetic camera: exposure, photons, read-out, response curve, and steps of the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.curves.curve import Curve
from rsibr.capture.curves.srgb import SRGB


@dataclass(frozen=True)
class Sensor:
    """Camera sensor.

    Attributes
    ----------
    curve : Curve
        Encoded value of an exposure.
    bits : int
        8 or 16, of the file.
    full_well : float
        Electrons of a pixel that is just saturated: the noise of photons is the square root of the electrons.
    read_noise : float
        Standard deviation of the read-out [electrons].
    """

    curve: Curve = SRGB
    bits: int = 8
    full_well: float = 30_000.0
    read_noise: float = 5.0

    def photographed(
        self, radiance: NDArray[np.floating], exposure: float, rng: np.random.Generator
    ) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """Photograph of a picture.

        Parameters
        ----------
        radiance : ndarray, shape (H, W, 3)
            Mean radiance over each pixel.
        exposure : float
            Share of the full well that a radiance of 1 fills.
        rng : Generator
            Source of the noise.

        Returns
        -------
        ndarray, shape (H, W, 3)
            Integers of the file, clipped where the sensor is saturated.
        """
        electrons = np.clip(np.asarray(radiance, dtype=np.float64) * exposure, 0.0, 4.0) * self.full_well
        read_out = rng.poisson(electrons) + rng.normal(0.0, self.read_noise, electrons.shape)
        encoded = self.curve.encoded(np.clip(read_out / self.full_well, 0.0, 1.0))
        steps: NDArray[np.float64] = np.rint(encoded * (2**self.bits - 1))
        return steps.astype(np.uint8) if self.bits == 8 else steps.astype(np.uint16)

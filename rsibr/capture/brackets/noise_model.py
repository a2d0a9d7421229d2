"""Noise of a camera: photons, read-out, and the steps of the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError

Array = NDArray[np.float64]

_LEAST, _MOST = 1e-6, 1e12


@dataclass(frozen=True)
class NoiseModel:
    """Variance of the exposure that a pixel records.

    Attributes
    ----------
    full_well : float
        Electrons of a pixel that is just saturated.
    read_noise : float
        Standard deviation of the read-out [electrons].

    Notes
    -----
    With exposure e relative to saturation, full well F and read noise r: σ² = e/F + (r/F)² + (q·de/dz)²/12, where q is
    the step of the file and z the encoded value (Hasinoff, Durand, Freeman 2010, equations 1 and 2, in these units).
    """

    full_well: float = 20_000.0
    read_noise: float = 5.0

    def __post_init__(self) -> None:
        for name, value in (("full_well", self.full_well), ("read_noise", self.read_noise)):
            if not _LEAST <= value <= _MOST:
                fix = f"give {_LEAST:g} to {_MOST:g} electrons"
                raise InputError(f"{name} is {value:g}", where="noise", fix=fix)

    def variance(self, exposure: Array, step: Array | float) -> Array:
        """Variance of relative exposures.

        Parameters
        ----------
        exposure : ndarray
            Expected exposure relative to saturation.
        step : ndarray or float
            Step of the file in units of exposure: the curve's slope over the number of levels; 0 for floats.
        """
        photons = np.maximum(exposure, 0.0) / self.full_well
        return photons + (self.read_noise / self.full_well) ** 2 + np.square(step) / 12

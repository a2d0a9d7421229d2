"""Delta lights: distant lights without extent, such as Mitsuba's `directional`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class DeltaLights:
    """Distant lights without extent; no image of the environment holds them.

    Attributes
    ----------
    directions : ndarray, shape (K, 3), float32
        Unit directions to the lights in world coordinates.
    irradiance : ndarray, shape (K, 3), float32
        Irradiance of a surface that faces the light [W m⁻²], linear Rec.709.
    """

    directions: NDArray[np.float32]
    irradiance: NDArray[np.float32]

    @classmethod
    def none(cls) -> DeltaLights:
        """No delta lights."""
        return cls(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))

    def __len__(self) -> int:
        return len(self.directions)

    @property
    def is_black(self) -> bool:
        """Whether none of them shines."""
        return not self.irradiance.any()

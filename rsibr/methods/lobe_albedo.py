"""Directional albedo of a lobe on the device."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.methods.cosine_table import CosineTable

_LEAST = 1e-4  # where an albedo vanishes, at grazing, a quotient by it would not
_LEAST_SHARE = 1e-3  # of the largest


@dataclass(eq=False)
class LobeAlbedo:
    """E(cos θ), to be looked up and divided by.

    Attributes
    ----------
    table : CosineTable
        Albedo, RGB, never zero.
    """

    table: CosineTable

    @classmethod
    def of(cls, albedo: NDArray[np.float64]) -> LobeAlbedo:
        """Put a table of shape (NODES, 3) on the device; see `rsibr.lobes.albedo`."""
        return cls(CosineTable.of(np.maximum(albedo, _LEAST * max(_LEAST_SHARE, float(albedo.max())))))

    def at(self, cosine: mi.Float) -> mi.Color3f:
        """Albedo at cos θ, linear between the nodes."""
        values = self.table.at(cosine)
        return mi.Color3f(values.x, values.y, values.z)

"""Directional albedo of a lobe on the device."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.methods.cosine_table import CosineTable

_LEAST = 1e-4  # minimum over the table's maximum: keeps quotients finite where the albedo vanishes at grazing angles
_LEAST_SHARE = 1e-3  # minimum of that maximum


@dataclass(eq=False)
class LobeAlbedo:
    """Directional albedo E(cos θ), bounded away from zero so that it can be divided by.

    Attributes
    ----------
    table : CosineTable
        Albedo, RGB, positive.
    """

    table: CosineTable

    @classmethod
    def of(cls, albedo: NDArray[np.float64]) -> LobeAlbedo:
        """Put a table of shape (NODES, 3) on the device; see `rsibr.lobes.albedo`."""
        return cls(CosineTable.of(divisible(albedo)))

    def at(self, cosine: mi.Float) -> mi.Color3f:
        """Albedo at cos θ, linear between the nodes."""
        return self.table.colour(cosine)


def divisible(albedo: NDArray[np.float64]) -> NDArray[np.float64]:
    """Table of an albedo, (NODES, 3), bounded away from zero."""
    return np.maximum(albedo, _LEAST * max(_LEAST_SHARE, float(albedo.max())))

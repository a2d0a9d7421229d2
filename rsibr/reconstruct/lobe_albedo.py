"""Directional albedo of a lobe on the device."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.resident import resident

_LEAST = 1e-4  # where an albedo vanishes, at grazing, a quotient by it would not
_LEAST_SHARE = 1e-3  # of the largest


@dataclass(eq=False)
class LobeAlbedo:
    """E(cos θ), to be looked up.

    Attributes
    ----------
    nodes : mi.Float
        Albedo at nodes even in √cos θ: RGB and padding, flat.
    """

    nodes: mi.Float

    @classmethod
    def of(cls, table: NDArray[np.float64]) -> LobeAlbedo:
        """Put a table of shape (NODES, 3) on the device; see `rsibr.effects.albedo`."""
        padded = np.zeros((len(table), 4), dtype=np.float32)
        padded[:, :3] = np.maximum(table, _LEAST * max(_LEAST_SHARE, float(table.max())))
        return cls(resident(mi.Float, padded))

    def at(self, cosine: mi.Float) -> mi.Color3f:
        """Albedo at cos θ, linear between the nodes; never zero."""
        last = len(self.nodes) // 4 - 1
        place = dr.sqrt(dr.clip(cosine, 0, 1)) * last
        below = dr.minimum(mi.UInt32(place), last - 1)
        mean = dr.lerp(
            dr.gather(mi.Vector4f, self.nodes, below),
            dr.gather(mi.Vector4f, self.nodes, below + 1),
            place - mi.Float(below),
        )
        return mi.Color3f(mean.x, mean.y, mean.z)

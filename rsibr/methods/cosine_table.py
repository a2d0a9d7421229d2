"""Lookup table by the cosine of the surface angle, four channels, on the device."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device


@dataclass(eq=False)
class CosineTable:
    """Table with nodes evenly spaced in √cos θ, densest in angle near grazing.

    Attributes
    ----------
    nodes : mi.Float
        Four floats a node, from grazing (cos θ = 0) to head-on, flat.
    """

    nodes: mi.Float

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> CosineTable:
        """Put values of shape (nodes, 3 or 4) on the device; a missing fourth channel is zero."""
        padded = np.zeros((len(values), 4), dtype=np.float32)
        padded[:, : values.shape[1]] = values
        return cls(to_device(mi.Float, padded))

    def at(self, cosine: mi.Float) -> mi.Vector4f:
        """Values at cos θ, linear between the nodes."""
        last = len(self.nodes) // 4 - 1
        place = dr.sqrt(dr.clip(cosine, 0, 1)) * last
        below = dr.minimum(mi.UInt32(place), last - 1)
        return dr.lerp(
            dr.gather(mi.Vector4f, self.nodes, below),
            dr.gather(mi.Vector4f, self.nodes, below + 1),
            place - mi.Float(below),
        )

    def colour(self, cosine: mi.Float) -> mi.Color3f:
        """First three channels at cos θ, linear between the nodes."""
        values = self.at(cosine)
        return mi.Color3f(values.x, values.y, values.z)

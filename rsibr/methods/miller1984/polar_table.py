"""Table of colours in polar coordinates on the device; Miller & Hoffman (1984), sections 4.3 and 7.1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.geometry.projections.latlong import POLAR

Lookup = Literal["bilinear", "nearest"]
"""How a table is read between its texels' middles."""

LOOKUPS = ("bilinear", "nearest")
"""Words of `Lookup`."""


@dataclass(eq=False)
class PolarTable:
    """Colours by direction in the projection `POLAR`, in one or several layers.

    Attributes
    ----------
    texels : BorderedTexels
        Texels, a sheet a layer.
    is_nearest : bool
        Whether a lookup takes the texel that holds the direction; otherwise it is bilinear.
    """

    texels: BorderedTexels
    is_nearest: bool

    @classmethod
    def of(cls, values: NDArray[np.floating], lookup: Lookup = "bilinear") -> PolarTable:
        """Put a table of shape (H, W, 3), or layers of it (K, H, W, 3), on the device."""
        layers = np.asarray(values, dtype=np.float32).reshape(-1, *values.shape[-3:])
        framed = np.concatenate([POLAR.bordered(layer[None]) for layer in layers])
        return cls(BorderedTexels.of(framed, *POLAR.axes(layers.shape[1:3])), lookup == "nearest")

    def fetch(self, d: mi.Vector3f, layer: mi.UInt32 | int = 0) -> mi.Color3f:
        """Values in the unit directions `d`, in a layer."""
        _, p = POLAR.place(d)
        value = (self.texels.nearest if self.is_nearest else self.texels.lookup)(mi.UInt32(layer), p)
        return mi.Color3f(value.x, value.y, value.z)

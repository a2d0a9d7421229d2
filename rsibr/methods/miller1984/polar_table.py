"""Table of colours in polar coordinates on the device; Miller & Hoffman (1984), sections 4.3 and 7.1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.to_device import to_device

Lookup = Literal["bilinear", "nearest"]
"""How a table is read between its texels' middles."""


@dataclass(eq=False)
class PolarTable:
    """Colours by direction: rows by latitude v = arccos y from +Y, columns by longitude u = arctan(x, z) from +Z.

    Attributes
    ----------
    texels : mi.Float
        Four floats a texel, row-major, with a border of one texel from across the poles and the seam, flat; one layer
        after the other.
    rows, columns : mi.UInt32
        Size without the border (opaque).
    is_nearest : bool
        Whether a lookup takes the texel that holds the direction; otherwise it is bilinear.
    """

    texels: mi.Float
    rows: mi.UInt32
    columns: mi.UInt32
    is_nearest: bool

    @classmethod
    def of(cls, values: NDArray[np.floating], lookup: Lookup = "bilinear") -> PolarTable:
        """Put a table of shape (H, W, 3), or layers of it (K, H, W, 3), on the device; W is even.

        With an even number of columns the rows next to a pole meet at texels' middles.
        """
        rows, columns, _ = values.shape[-3:]
        padded = np.zeros((*values.shape[:-3], rows + 2, columns + 2, 4), dtype=np.float32)
        padded[..., :3] = bordered(values)
        sizes = (dr.opaque(mi.UInt32, size) for size in (rows, columns))
        return cls(to_device(mi.Float, padded), *sizes, is_nearest=lookup == "nearest")

    def fetch(self, d: mi.Vector3f, layer: mi.UInt32 | int = 0) -> mi.Color3f:
        """Values in the unit directions `d`, in a layer."""
        u, v = longitude_latitude(d)
        column, row = u * mi.Float(self.columns), v * mi.Float(self.rows)
        stride = self.columns + 2
        start = layer * stride * (self.rows + 2)
        if self.is_nearest:
            left, top = dr.minimum(mi.UInt32(column), self.columns - 1), dr.minimum(mi.UInt32(row), self.rows - 1)
            return _colour(dr.gather(mi.Vector4f, self.texels, start + dr.fma(top + 1, stride, left + 1)))
        cell = BilinearCell.at(
            dr.minimum(column, mi.Float(self.columns)) + 0.5, dr.minimum(row, mi.Float(self.rows)) + 0.5
        )
        corner = start + cell.corner(stride)
        upper, lower = (
            dr.lerp(
                dr.gather(mi.Vector4f, self.texels, first),
                dr.gather(mi.Vector4f, self.texels, first + 1),
                cell.rightward,
            )
            for first in (corner, corner + stride)
        )
        return _colour(dr.lerp(upper, lower, cell.downward))


def bordered(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Add a border of one texel: across a pole lies the other side of the same row, across the seam the other end."""
    over = values.shape[-2] // 2
    first, last = (np.roll(row, over, axis=-2) for row in (values[..., :1, :, :], values[..., -1:, :, :]))
    rows = np.concatenate([first, values, last], axis=-3)
    return np.concatenate([rows[..., -1:, :], rows, rows[..., :1, :]], axis=-2)


def longitude_latitude(d: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Longitude arctan(x, z) as a part of the turn, in [0, 1], and latitude arccos y as a part of π, in [0, 1]."""
    turn = dr.atan2(d.x, d.z) * dr.inv_two_pi
    polar = dr.atan2(dr.sqrt(d.x * d.x + d.z * d.z), d.y)  # an arccosine in float32 errs by 0.02° at the poles
    return turn - dr.floor(turn), polar * dr.inv_pi


def _colour(texel: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(texel.x, texel.y, texel.z)

"""Texels of all sheets of a sphere image on the device, each sheet in a border of one texel."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.projections.texel_axis import TexelAxis
from rsibr.geometry.to_device import to_device


@dataclass(eq=False)
class BorderedTexels:
    """Sheets on the device.

    Attributes
    ----------
    texels : mi.Float
        Four floats a texel, flat, of which the last is 1 by default: packets of four are loaded at once.
    scale, shift : mi.Vector2f
        Texels per unit, and place of the point 0 in texels, of columns and rows (opaque).
    stride, height : mi.UInt32
        Columns and rows of a sheet with its border (opaque).
    """

    texels: mi.Float
    scale: mi.Vector2f
    shift: mi.Vector2f
    stride: mi.UInt32
    height: mi.UInt32

    @classmethod
    def of(cls, framed: NDArray[np.float32], columns: TexelAxis, rows: TexelAxis) -> BorderedTexels:
        """Copy sheets to the device.

        Parameters
        ----------
        framed : ndarray, shape (F, H + 2, W + 2, 3 or 4)
            Sheets in their borders.
        columns, rows : TexelAxis
            Axes of the sheets, without the borders.
        """
        four = np.pad(framed, ((0, 0), (0, 0), (0, 0), (0, 4 - framed.shape[3])), constant_values=1.0)
        scale = mi.Vector2f(columns.scale, rows.scale)
        shift = mi.Vector2f(1 - columns.first, 1 - rows.first)
        dr.make_opaque(scale, shift)
        stride, height = (dr.opaque(mi.UInt32, size) for size in (framed.shape[2], framed.shape[1]))
        return cls(to_device(mi.Float, four), scale, shift, stride, height)

    def lookup(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector4f:
        """Interpolate bilinearly at points p in [0, 1]² of sheets."""
        cell = BilinearCell.at(dr.fma(p.x, self.scale.x, self.shift.x), dr.fma(p.y, self.scale.y, self.shift.y))
        # NaN becomes an index beyond the texels, where a read ends the process
        left, top = dr.minimum(cell.left, self.stride - 2), dr.minimum(cell.top, self.height - 2)
        corner = dr.fma(sheet, self.stride * self.height, dr.fma(top, self.stride, left))
        upper = dr.lerp(self._texel(corner), self._texel(corner + 1), cell.rightward)
        below = corner + self.stride
        lower = dr.lerp(self._texel(below), self._texel(below + 1), cell.rightward)
        return dr.lerp(upper, lower, cell.downward)

    def nearest(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector4f:
        """Texel that holds a point p in [0, 1]² of a sheet."""
        column = dr.clip(mi.UInt32(dr.fma(p.x, self.scale.x, self.shift.x + 0.5)), 1, self.stride - 2)
        row = dr.clip(mi.UInt32(dr.fma(p.y, self.scale.y, self.shift.y + 0.5)), 1, self.height - 2)
        return self._texel(dr.fma(sheet, self.stride * self.height, dr.fma(row, self.stride, column)))

    def _texel(self, index: mi.UInt32) -> mi.Vector4f:
        return dr.gather(mi.Vector4f, self.texels, index)

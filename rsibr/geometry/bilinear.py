"""Bilinear interpolation in an image: the cell of four texels around a point, and the point's place in it."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True)
class BilinearCell:
    """Four neighbouring texels, one cell a lane.

    Attributes
    ----------
    left, top : mi.UInt32
        Column and row of the upper left texel.
    rightward, downward : mi.Float
        Place of the point between the texels' centres, in [0, 1).
    """

    left: mi.UInt32
    top: mi.UInt32
    rightward: mi.Float
    downward: mi.Float

    @classmethod
    def at(cls, column: mi.Float, row: mi.Float) -> BilinearCell:
        """Cell of a point.

        Parameters
        ----------
        column, row : mi.Float
            Image coordinates ≥ 0, in texels; whole numbers are texel centres.
        """
        left, top = mi.UInt32(column), mi.UInt32(row)
        return cls(left, top, column - mi.Float(left), row - mi.Float(top))

    @classmethod
    def in_sphere_map(cls, p: mi.Point2f, half: mi.Float | float) -> BilinearCell:
        """Cell of a point in a sphere map with a border of one texel.

        The border makes every coordinate positive and every neighbour exist, so nothing is clamped.

        Parameters
        ----------
        p : mi.Point2f
            Points of the closed unit disk, y up; never NaN.
        half : mi.Float or float
            Half the texels a side, without the border.
        """
        return cls.at(dr.fma(p.x, half, half + 0.5), dr.fma(p.y, -half, half + 0.5))

    def corner(self, stride: mi.UInt32 | int) -> mi.UInt32:
        """Index of the upper left texel in a row-major image of `stride` texels a row."""
        return dr.fma(self.top, stride, self.left)

"""Reconstructed maps of a few views on the device, with MIP levels."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.geometry.bilinear import BilinearCell

BORDER = 1
"""Texels around each level, so that bilinear lookups at the rim clamp nothing."""


@dataclass
class ViewMaps:
    """Maps of some views and their levels.

    Level 0 holds the maps, each further level half as many texels a side, the last one texel. A texel is the mean over
    its part inside the disk; texels outside hold the value of the nearest one inside.

    Attributes
    ----------
    texels : mi.Float
        RGB and coverage of all texels, flat: maps one after another, in each its levels, row by row with their borders.
        Coverage is the share of the texel inside the disk, zero on the border.
    frames : mi.Float
        Frame of each view, nine floats each: columns x, y, z in world coordinates.
    first : mi.UInt32
        First texel of each level in a map.
    map_size : mi.UInt32
        Texels a map. Opaque, as are the next two: maps of another size share kernels.
    half : mi.Float
        Half the texels a side of level 0.
    last : mi.UInt32
        Number of the last level.
    """

    texels: mi.Float
    frames: mi.Float
    first: mi.UInt32
    map_size: mi.UInt32
    half: mi.Float
    last: mi.UInt32

    def to_local(self, index: mi.UInt32, direction: mi.Vector3f) -> mi.Vector3f:
        """Transform a direction from world coordinates to the frame of the map `index`: T_d⁻¹."""
        columns = [dr.gather(mi.Vector3f, self.frames, 3 * index + axis) for axis in range(3)]
        return mi.Vector3f(*(dr.dot(column, direction) for column in columns))

    def texel(self, index: mi.UInt32, level: mi.UInt32, column: mi.UInt32, row: mi.UInt32) -> mi.Vector4f:
        """RGB and coverage of a texel; column and row count from the border: 1 is the first texel of the map."""
        start = dr.fma(index, self.map_size, dr.gather(mi.UInt32, self.first, level))
        return dr.gather(mi.Vector4f, self.texels, start + row * self.stride(level) + column)

    def stride(self, level: mi.UInt32) -> mi.UInt32:
        """Texels of a row of a level, border included."""
        return (mi.UInt32(2 * self.half) >> level) + 2 * BORDER

    def half_of(self, level: mi.UInt32) -> mi.Float:
        """Half the texels a side of a level, without the border."""
        return self.half / mi.Float(mi.UInt32(1) << level)

    def fetch(self, index: mi.UInt32, p: mi.Point2f, level: mi.UInt32 | int = 0) -> mi.Color3f:
        """Bilinear lookup in one level.

        Parameters
        ----------
        index : mi.UInt32
            Map.
        p : mi.Point2f
            Points of the closed unit disk; never NaN.
        level : mi.UInt32
            Level.
        """
        level = mi.UInt32(level)
        cell = BilinearCell.in_sphere_map(p, self.half_of(level))
        start = dr.fma(index, self.map_size, dr.gather(mi.UInt32, self.first, level))
        stride = self.stride(level)
        corner = start + cell.corner(stride)
        top = self._row(corner, cell.rightward)
        return dr.lerp(top, self._row(corner + stride, cell.rightward), cell.downward)

    def fetch_between(self, index: mi.UInt32, p: mi.Point2f, level: mi.Float) -> mi.Color3f:
        """Trilinear lookup: bilinear in the two levels around `level`."""
        level = dr.clip(level, 0, mi.Float(self.last))
        fine = dr.minimum(mi.UInt32(level), self.last)
        coarse = dr.minimum(fine + 1, self.last)
        return dr.lerp(self.fetch(index, p, fine), self.fetch(index, p, coarse), level - mi.Float(fine))

    def _row(self, texel: mi.UInt32, rightward: mi.Float) -> mi.Color3f:
        left, right = (dr.gather(mi.Vector4f, self.texels, texel + k) for k in range(2))
        return mi.Color3f(dr.lerp(left.xyz, right.xyz, rightward))

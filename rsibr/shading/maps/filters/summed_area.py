"""Mean over a rectangle by a summed-area table; Miller & Hoffman (1984), section 8.3; Crow (1984)."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.map_filter import Reader, over_patches, register_filter
from rsibr.shading.maps.view_maps import BORDER, ViewMaps

_LEAST_COVERAGE = 1e-3  # texels inside the disk below which the rectangle holds nothing


class SummedArea:
    """Mean over the axis-parallel rectangle with the second moments of the footprint's quadrilateral.

    Notes
    -----
    A table must hold the highest radiance times the number of texels, and resolve the lowest. Sums in float64 resolve
    2⁻⁵³ of the largest: under a sun of 10⁶ over a whole map of 256² texels, 1e-5. float32 would be off by 4000. The
    sums are of radiance times coverage, and are divided by sums of coverage: nothing beyond the rim enters.
    """

    summary = "a rectangle of the footprint's size, by a summed-area table"
    needs_footprint = True
    has_levels = False

    def reader(self, maps: ViewMaps) -> Reader:
        """See `MapFilter`."""
        table = SumTable.of(maps)

        def over_bounds(index: mi.UInt32, patch: Patch) -> mi.Color3f:
            low, high = _rectangle(patch, maps)
            total = table.within(index, low, high)
            mean = mi.Color3f(total.xyz / dr.maximum(total.w, _LEAST_COVERAGE))
            return dr.select(total.w > _LEAST_COVERAGE, mean, maps.fetch(index, patch.middle))

        return over_patches(maps, over_bounds)


@dataclass
class SumTable:
    """Inclusive sums of radiance × coverage, and of coverage, over all texels to the left and above.

    Attributes
    ----------
    sums : mi.Float64
        Four values a texel, flat: maps, columns, rows.
    side : mi.UInt32
        Texels a side.
    """

    sums: mi.Float64
    side: mi.UInt32

    @classmethod
    def of(cls, maps: ViewMaps) -> SumTable:
        """Sum the maps."""
        side = int(2 * maps.half[0])
        count = dr.width(maps.frames) // 9
        wide = dr.opaque(mi.UInt32, side)
        lane = dr.arange(mi.UInt32, count * side * side)
        column, row, number = lane % wide, lane // wide % wide, lane // (wide * wide)
        texel = maps.texel(number, mi.UInt32(0), column + BORDER, row + BORDER)
        values = [mi.Float64(x) * mi.Float64(texel.w) for x in texel.xyz] + [mi.Float64(texel.w)]
        sums, turned = dr.empty(mi.Float64, 4 * dr.width(lane)), number * wide * wide + column * wide + row
        for channel, value in enumerate(values):
            along = dr.block_prefix_reduce(dr.ReduceOp.Add, value, side, exclusive=False)
            other = dr.empty(mi.Float64, dr.width(lane))
            dr.scatter(other, along, turned)
            whole = dr.block_prefix_reduce(dr.ReduceOp.Add, other, side, exclusive=False)
            dr.scatter(sums, whole, 4 * lane + channel)
        dr.eval(sums)
        return cls(sums, wide)

    def within(self, index: mi.UInt32, low: mi.Point2f, high: mi.Point2f) -> mi.Vector4f:
        """Integral over a rectangle of texels, given by its edges in texels from the top left."""
        most = mi.Float(self.side)
        low, high = dr.clip(low, 0, most), dr.clip(high, 0, most)
        places = [(high.x, high.y), (low.x, high.y), (high.x, low.y), (low.x, low.y)]
        a, b, c, d = (self._to(index, *place) for place in places)
        return mi.Vector4f((a - b) - (c - d))

    def _to(self, index: mi.UInt32, x: mi.Float, y: mi.Float) -> mi.Vector4d:
        """Integral from the top left to a point: bilinear between the sums, which is exact for even texels."""
        last = self.side - 1
        column, row = dr.minimum(mi.UInt32(x), last), dr.minimum(mi.UInt32(y), last)
        rightward, downward = mi.Float64(x) - mi.Float64(column), mi.Float64(y) - mi.Float64(row)
        start = index * self.side * self.side

        def sums(k: int, m: int) -> mi.Vector4d:
            """Sum up to the edges `column + k` and `row + m`; zero at the first edges."""
            i, j = column + k, row + m
            place = start + (i - 1) * self.side + (j - 1)
            return dr.gather(mi.Vector4d, self.sums, place, (i > 0) & (j > 0))

        left, right = (dr.lerp(sums(k, 0), sums(k, 1), downward) for k in range(2))
        return dr.lerp(left, right, rightward)


def _rectangle(patch: Patch, maps: ViewMaps) -> tuple[mi.Point2f, mi.Point2f]:
    """Edges of the rectangle in texels from the top left: at least one texel a side, where it is a bilinear lookup."""
    a, b, c, d = patch.outline
    across, down = 0.25 * (b + c - a - d), 0.25 * (c + d - a - b)
    centre = 0.25 * (a + b + c + d)
    reach = dr.sqrt(dr.square(across) + dr.square(down)) * maps.half
    reach = dr.maximum(reach, 0.5)
    at = mi.Point2f(dr.fma(centre.x, maps.half, maps.half), dr.fma(centre.y, -maps.half, maps.half))
    return at - reach, at + reach


register_filter("sat", SummedArea)

"""Mean over the quadrilateral of the footprint's corners; Miller & Hoffman (1984), section 8.2."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.map_filter import Reader, over_patches, register_filter
from rsibr.shading.maps.view_maps import BORDER, ViewMaps

MOST_TEXELS = 16
"""Most texels in either direction; larger quadrilaterals are taken from a coarser level."""

FEWEST_TEXELS = 2
"""Texels below which the corners are averaged."""


class Quadrilateral:
    """Mean of the texels inside the quadrilateral of the corners, weighted by their area inside the disk.

    Notes
    -----
    The quadrilateral is a pair of triangles, so that folded ones, as at inflections of a surface, have an inside. The
    weight of a texel falls from 1 to 0 over one texel across each edge, about the area of its part inside. Of a
    quadrilateral that spans less than `FEWEST_TEXELS`, whose sum would depend on where centres lie, the average of
    bilinear lookups at the corners is taken.
    """

    summary = "texels inside the quadrilateral of the corners"
    needs_footprint = True
    has_levels = True

    def reader(self, maps: ViewMaps) -> Reader:
        """See `MapFilter`."""
        return over_patches(maps, lambda index, patch: _mean(maps, index, patch))


def _mean(maps: ViewMaps, index: mi.UInt32, patch: Patch) -> mi.Color3f:
    # ---- Level and bounds, in texels of it ----
    outline = patch.outline
    low, high = outline[0], outline[0]
    for p in outline[1:]:
        low, high = dr.minimum(low, p), dr.maximum(high, p)
    extent = dr.max(high - low) * maps.half
    level = mi.UInt32(dr.ceil(dr.log2(dr.maximum(extent * (1 / MOST_TEXELS), 1))))
    level = dr.minimum(level, maps.last)
    half = maps.half_of(level)
    a, b, c, d = (mi.Point2f(dr.fma(p.x, half, half + 0.5), dr.fma(p.y, -half, half + 0.5)) for p in outline)
    most = mi.Float(maps.stride(level) - 1 - BORDER)
    left, top = (_clipped(dr.floor(x), most) for x in (dr.minimum(dr.minimum(a, b), dr.minimum(c, d))))
    right, bottom = (_clipped(dr.ceil(x), most) for x in (dr.maximum(dr.maximum(a, b), dr.maximum(c, d))))

    # ---- Sum over the texels of the bounds ----
    def step(
        column: mi.UInt32, row: mi.UInt32, total: mi.Color3f, weights: mi.Float
    ) -> tuple[mi.UInt32, mi.UInt32, mi.Color3f, mi.Float]:
        centre = mi.Point2f(mi.Float(column), mi.Float(row))
        seen = maps.texel(index, level, column, row)
        weight = seen.w * (_inside(centre, a, b, c) + _inside(centre, a, c, d))
        is_last = column >= right
        below = row + dr.select(is_last, mi.UInt32(1), 0)
        return dr.select(is_last, left, column + 1), below, total + weight * mi.Color3f(seen.xyz), weights + weight

    _, _, total, weights = dr.while_loop(
        state=(mi.UInt32(left), mi.UInt32(top), mi.Color3f(0), mi.Float(0)),
        cond=lambda _column, row, _total, _weights: row <= bottom,
        body=step,
        labels=("column", "row", "total", "weights"),
        label="quadrilateral",
    )
    corners = mi.Color3f(0)
    for p in outline:
        corners += 0.25 * maps.fetch(index, p, level)
    return dr.select((weights > 1e-3) & (extent > FEWEST_TEXELS), total / weights, corners)


def _clipped(x: mi.Float, most: mi.Float) -> mi.UInt32:
    return mi.UInt32(dr.clip(x, BORDER, most))


def _inside(x: mi.Point2f, a: mi.Point2f, b: mi.Point2f, c: mi.Point2f) -> mi.Float:
    """Weight of the texel centred at `x` in the triangle (a, b, c): 1 inside, ½ on an edge, 0 half a texel beyond."""
    turn = dr.select(_cross(b - a, c - a) < 0, mi.Float(-1), 1)
    nearest = mi.Float(1)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = dr.norm(edge)
        beside = turn * _cross(edge, x - start) / dr.maximum(length, 1e-12)
        away = 0.5 - dr.norm(x - start)  # an edge without length is a point
        nearest = dr.minimum(nearest, dr.select(length > 1e-6, 0.5 + beside, away))
    return dr.maximum(nearest, 0)


def _cross(a: mi.Vector2f, b: mi.Vector2f) -> mi.Float:
    return a.x * b.y - a.y * b.x


register_filter("quadrilateral", Quadrilateral)

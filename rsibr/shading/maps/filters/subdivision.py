"""Recursive subdivision of a pixel; Miller & Hoffman (1984), section 8.1."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.map_filter import Reader, over_patches, register_filter
from rsibr.shading.maps.view_maps import ViewMaps

MOST_PARTS = 64
"""Most parts of a footprint in either direction."""


class Subdivision:
    """Mean over parts of the footprint, each no longer than a texel, of the average of its four corners.

    Notes
    -----
    The paper halves each region until its corners lie in the same or in adjacent texels. Here all parts of a footprint
    are divided as finely as its longer sides demand, in both directions separately, which needs no stack: the result is
    that of the recursion or finer. Directions between the corners are interpolated bilinearly and normalised.
    """

    summary = "parts of at most a texel, their corners averaged"
    needs_footprint = True
    has_levels = False

    def reader(self, maps: ViewMaps) -> Reader:
        """See `MapFilter`."""
        return over_patches(maps, lambda index, patch: _mean(maps, index, patch))


def _mean(maps: ViewMaps, index: mi.UInt32, patch: Patch) -> mi.Color3f:
    corners, (a, b, c, d) = patch.corners or [], patch.outline
    across = _parts(dr.maximum(dr.norm(b - a), dr.norm(c - d)), maps)
    down = _parts(dr.maximum(dr.norm(d - a), dr.norm(c - b)), maps)
    steps = mi.Vector2f(dr.rcp(mi.Float(across)), dr.rcp(mi.Float(down)))

    def step(i: mi.UInt32, j: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.UInt32, mi.Color3f]:
        x, y = mi.Float(i) * steps.x, mi.Float(j) * steps.y
        direction = dr.lerp(dr.lerp(corners[0], corners[1], x), dr.lerp(corners[3], corners[2], x), y)
        unit = direction * dr.rsqrt(dr.maximum(dr.squared_norm(direction), 1e-20))
        total += _end(i, across) * _end(j, down) * maps.fetch(index, patch.indexing.disk(unit))
        is_last = i >= across  # no division: that of integers by zero, in lanes that are off, ends the process
        return dr.select(is_last, 0, i + 1), j + dr.select(is_last, mi.UInt32(1), 0), total

    _, _, total = dr.while_loop(
        state=(mi.UInt32(0), mi.UInt32(0), mi.Color3f(0)),
        cond=lambda _i, j, _total: j <= down,
        body=step,
        labels=("i", "j", "total"),
        label="subdivision",
    )
    return mi.Color3f(total * (steps.x * steps.y))


def _parts(length: mi.Float, maps: ViewMaps) -> mi.UInt32:
    """Parts into which a side of the footprint is divided."""
    return mi.UInt32(dr.clip(dr.ceil(length * maps.half), 1, MOST_PARTS))


def _end(k: mi.UInt32, parts: mi.UInt32) -> mi.Float:
    """Weight of a corner: it belongs to one part at an end, to two between."""
    return dr.select((k == 0) | (k == parts), mi.Float(0.5), 1)


register_filter("subdivision", Subdivision)

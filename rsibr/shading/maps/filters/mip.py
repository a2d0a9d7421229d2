"""MIP-mapped maps: a trilinear lookup at the level of the footprint; Cabral et al. (1999), figure 5."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.map_filter import Reader, over_patches, register_filter
from rsibr.shading.maps.view_maps import ViewMaps

SHARPER = 0.5
"""Levels below that of texels as large as the footprint: bilinear lookups are wider than a texel, by about √2."""


class MipMapped:
    """Trilinear lookup; Williams (1983), *Pyramidal parametrics*.

    Notes
    -----
    The level is log₂ of the geometric mean of the footprint's two sides, in texels, less `SHARPER`. OpenGL takes the
    longer side: measured on a capsule and a bumpy sphere at one ray a pixel, that errs 4 to 14 times as much.
    """

    summary = "trilinear in MIP levels, by the footprint's sides"
    needs_footprint = True
    has_levels = True

    def reader(self, maps: ViewMaps) -> Reader:
        """See `MapFilter`."""
        return over_patches(maps, lambda index, patch: maps.fetch_between(index, patch.middle, level_of(patch, maps)))


def level_of(patch: Patch, maps: ViewMaps) -> mi.Float:
    """Level at which a patch is as wide as a trilinear lookup, at least 0."""
    first, second, third, fourth = patch.outline
    across = 0.5 * (second + third - first - fourth)
    down = 0.5 * (third + fourth - first - second)
    area = dr.norm(across) * dr.norm(down) * dr.square(maps.half)
    return dr.maximum(0.5 * dr.log2(dr.maximum(area, 1e-9)) - SHARPER, 0)


register_filter("mip", MipMapped)

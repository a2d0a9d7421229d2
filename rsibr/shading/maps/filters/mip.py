"""MIP-mapped maps: a trilinear lookup at the level of the footprint; Cabral et al. (1999), figure 5."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.map_filter import Reader, register_filter
from rsibr.shading.maps.view_maps import ViewMaps


class MipMapped:
    """Trilinear lookup; Williams (1983), *Pyramidal parametrics*.

    Notes
    -----
    The level is that of OpenGL: log₂ of the longer side of the footprint, in texels.
    """

    summary = "trilinear in MIP levels, by the footprint's longer side"
    needs_footprint = True
    has_levels = True

    def reader(self, maps: ViewMaps) -> Reader:
        """See `MapFilter`."""

        def read(index: mi.UInt32, patch: Patch) -> mi.Color3f:
            if patch.corners is None:
                return maps.fetch(index, patch.middle)
            return maps.fetch_between(index, patch.middle, level_of(patch, maps))

        return read


def level_of(patch: Patch, maps: ViewMaps) -> mi.Float:
    """Level at which the longer side of a patch is one texel, at least 0."""
    first, second, third, fourth = patch.outline
    across = 0.5 * (second + third - first - fourth)
    down = 0.5 * (third + fourth - first - second)
    longest = dr.maximum(dr.squared_norm(across), dr.squared_norm(down)) * dr.square(maps.half)
    return 0.5 * dr.log2(dr.maximum(longest, 1))


register_filter("mip", MipMapped)

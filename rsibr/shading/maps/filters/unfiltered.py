"""No filter: a bilinear lookup at the ray itself."""

from __future__ import annotations

import mitsuba as mi

from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.map_filter import Reader, register_filter
from rsibr.shading.maps.view_maps import ViewMaps


class Unfiltered:
    """Bilinear lookup in the map itself."""

    summary = "one bilinear lookup"
    needs_footprint = False
    has_levels = False

    def reader(self, maps: ViewMaps) -> Reader:
        """See `MapFilter`."""

        def read(index: mi.UInt32, patch: Patch) -> mi.Color3f:
            return maps.fetch(index, patch.middle)

        return read


register_filter("none", Unfiltered)

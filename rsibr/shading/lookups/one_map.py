"""One reconstructed map for all surfaces of a picture: that of the camera's view direction."""

from __future__ import annotations

import mitsuba as mi

from rsibr.methods.protocol import Method
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.lookups.registry import Shade
from rsibr.shading.maps.indexing import Indexing, Patch
from rsibr.shading.maps.maker import MapMaker
from rsibr.shading.maps.map_filter import filter_named
from rsibr.shading.surfaces import Surfaces


class OneMap:
    """Lookup in the map of the camera's view direction.

    Parameters
    ----------
    method : Method
        Method of the bake.
    indexing : Indexing
        How surfaces index the map.
    filter : str
        One of `rsibr.shading.maps.map_filter.filters`.
    resolution : int
        Texels a side, a power of two.
    """

    def __init__(self, method: Method, indexing: Indexing, filter: str, resolution: int) -> None:
        self._indexing, self._filter = indexing, filter_named(filter)
        self._maker = MapMaker(method, resolution, self._filter.has_levels)

    @property
    def needs_footprint(self) -> bool:
        """See `Lookup`."""
        return self._filter.needs_footprint

    def toward(self, camera: Camera) -> Shade:
        """See `Lookup`."""
        maps = self._maker.maps([camera.axes])
        read = self._filter.reader(maps)

        def shade(surfaces: Surfaces) -> mi.Color3f:
            index = mi.UInt32(0)
            return read(index, Patch.of(surfaces, maps, index, self._indexing))

        return shade

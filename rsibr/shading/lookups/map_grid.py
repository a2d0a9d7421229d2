"""Maps of a grid of views over a picture, interpolated: between one map and a view of its own for each pixel."""

from __future__ import annotations

import mitsuba as mi

from rsibr.errors import InputError
from rsibr.methods.protocol import Method
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.lookups.registry import Shade, register_lookup
from rsibr.shading.maps.indexing import BY_NORMAL, BY_REFLECTION, Patch
from rsibr.shading.maps.maker import RESOLUTION, MapMaker
from rsibr.shading.maps.map_filter import filter_named
from rsibr.shading.maps.view_grid import ViewGrid
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import Surfaces

_INDEXINGS = {"reflection": BY_REFLECTION, "normal": BY_NORMAL}
_MOST = 32


@register_lookup("map-grid", summary="maps of a grid of views over the picture, interpolated")
class MapGrid:
    """Bilinear interpolation between the maps of four views around each pixel's own.

    Parameters
    ----------
    method : Method
        Method of the bake.
    scene : ObjectScene
        Its bounding box narrows the grid.
    grid : int, optional
        Views a side; by default by the field of view: 5 for 40°, at least 2 and at most 9.
    index : {"reflection", "normal"}
        How surfaces index the maps.
    filter : str
        One of `rsibr.shading.maps.map_filter.filters`.
    resolution : int
        Texels a side, a power of two.
    """

    def __init__(
        self,
        method: Method,
        scene: ObjectScene,
        *,
        grid: int | None = None,
        index: str = "reflection",
        filter: str = "none",
        resolution: int = RESOLUTION,
    ) -> None:
        if grid is not None and not 2 <= grid <= _MOST:
            raise InputError(f"a grid of {grid} views a side", where="grid", fix=f"give 2 to {_MOST}")
        if index not in _INDEXINGS:
            raise InputError(f"maps indexed by '{index}'", where="index", fix=f"give one of: {', '.join(_INDEXINGS)}")
        self._scene, self._side, self._indexing, self._filter = scene, grid, _INDEXINGS[index], filter_named(filter)
        self._maker = MapMaker(method, resolution, self._filter.has_levels)

    @property
    def needs_footprint(self) -> bool:
        """See `Lookup`."""
        return self._filter.needs_footprint

    def toward(self, camera: Camera) -> Shade:
        """See `Lookup`."""
        grid = ViewGrid.over(camera, self._scene, self._side)
        maps = self._maker.maps(grid.frames)
        read = self._filter.reader(maps)

        def shade(surfaces: Surfaces) -> mi.Color3f:
            radiance = mi.Color3f(0)
            for index, weight in grid.around(surfaces.v):
                radiance += weight * read(index, Patch.of(surfaces, maps, index, self._indexing))
            return radiance

        return shade

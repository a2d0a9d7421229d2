"""How surfaces index a reconstructed map: by their normal, or by the direction that they mirror."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.geometry.projections.sphere_map import disk_from_normal, disk_from_reflection
from rsibr.shading.maps.view_maps import ViewMaps
from rsibr.shading.surfaces import Surfaces


@dataclass(frozen=True)
class Indexing:
    """Index of a surface in a sphere map.

    Attributes
    ----------
    direction : callable
        (n, v) → direction in world coordinates that stands for the surface.
    disk : callable
        Direction in the map's frame → point of the disk.
    """

    direction: Callable[[mi.Vector3f, mi.Vector3f], mi.Vector3f]
    disk: Callable[[mi.Vector3f], mi.Point2f]


def _mirrored(n: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
    return 2 * dr.dot(n, v) * n - v


BY_NORMAL = Indexing(lambda n, _: n, disk_from_normal)
"""By the normal: g_normal⁻¹. Normals that face away from the map's view are moved to its rim."""

BY_REFLECTION = Indexing(_mirrored, disk_from_reflection)
"""By the mirror direction of the pixel's own view: g_mirror⁻¹, as OpenGL's sphere mapping."""


@dataclass
class Patch:
    """Part of a map that a ray stands for.

    Attributes
    ----------
    centre : mi.Vector3f
        Direction that the ray's surface stands for, in the map's frame.
    corners : list of mi.Vector3f or None
        Directions at the corners of its footprint, in order around it; None for a point.
    indexing : Indexing
        How directions index the map.
    """

    centre: mi.Vector3f
    corners: list[mi.Vector3f] | None
    indexing: Indexing

    @classmethod
    def of(cls, surfaces: Surfaces, maps: ViewMaps, index: mi.UInt32, indexing: Indexing) -> Patch:
        """Patch of surfaces in the map `index`."""

        def local(n: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
            return maps.to_local(index, indexing.direction(n, v))

        seen = surfaces.footprint
        corners = None if seen is None else [local(n, v) for n, v in zip(seen.n, seen.v, strict=True)]
        return cls(local(surfaces.n, surfaces.v), corners, indexing)

    @property
    def middle(self) -> mi.Point2f:
        """Point of the disk of the ray itself."""
        return self.indexing.disk(self.centre)

    @property
    def outline(self) -> list[mi.Point2f]:
        """Points of the disk at the corners; only with corners."""
        return [self.indexing.disk(corner) for corner in self.corners or []]

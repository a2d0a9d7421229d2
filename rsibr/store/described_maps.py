"""Maps with a manifest that are not a bake on disk: maps in memory, or maps modified when they are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.backend import Rendering
from rsibr.geometry.viewpoints import Viewpoints, from_directions, partial_views
from rsibr.light.radiance import Light
from rsibr.store.manifest import Manifest
from rsibr.store.map_file import MapFile
from rsibr.store.stored_maps import StoredMaps


@dataclass(frozen=True, eq=False, repr=False)
class DescribedMaps:
    """Base class of maps with a manifest: all properties that follow from the manifest.

    Attributes
    ----------
    path : Path
        Directory, or a name to show in messages.
    manifest : Manifest
        Manifest of the maps.
    """

    path: Path
    manifest: Manifest

    def __repr__(self) -> str:
        told = self.manifest
        views = f"{self.view_count} views of {self.resolution}²"
        return f"{type(self).__name__}({self.path.name!r}: {views}, {told.material.name} under {told.environment.name})"

    @property
    def view_count(self) -> int:
        """Number of stored views."""
        return len(self.manifest.views)

    @property
    def has_views(self) -> bool:
        """Whether there are views to blend; if all lobes are predicted from the environment, there is one view."""
        return len(self.manifest.triangles) > 0 or self.manifest.capture is not None

    @property
    def resolution(self) -> int:
        """Texels along each side of a map."""
        return self.manifest.resolution

    @property
    def rendering(self) -> Rendering:
        """Rendering of the maps; RGB in bakes without a plan."""
        return self.manifest.plan.rendering if self.manifest.plan else "rgb"

    @property
    def seconds(self) -> float:
        """Wall time of the whole bake [s]."""
        return self.manifest.whole_seconds

    @property
    def bytes(self) -> int:
        """Total size of all maps [bytes]."""
        return self.manifest.size

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """Unit view vectors, shape (V, 3), in the order of the maps; read-only."""
        directions = np.array(self.manifest.directions, np.float64)
        directions.setflags(write=False)
        return directions

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """Triangulation of the directions, shape (M, 3), indices into them; read-only."""
        triangles = np.array(self.manifest.triangles, np.int64).reshape(-1, 3)
        triangles.setflags(write=False)
        return triangles

    @cached_property
    def viewpoints(self) -> Viewpoints:
        """Directions and triangles, which need not cover the sphere in a capture."""
        capture = self.manifest.capture
        if capture is None:
            return from_directions(self.directions, self.triangles)
        return partial_views(self.directions, self.triangles, gap_deg=capture.gap_deg)


@dataclass(frozen=True, eq=False, repr=False)
class MapsInMemory(DescribedMaps):
    """Maps in memory, such as those of a probe.

    Attributes
    ----------
    maps : tuple of MapFile
        Map of each view of the manifest; or none, of a scene that was not baked.
    light : Light
        Environment from which the lobes are predicted.
    """

    maps: tuple[MapFile, ...]
    light: Light

    @property
    def view_count(self) -> int:
        """Number of maps."""
        return len(self.maps)

    def map(self, index: int) -> MapFile:
        """Return the map of one view."""
        return self.maps[index]


@dataclass(frozen=True, eq=False, repr=False)
class AlteredMaps(DescribedMaps):
    """Maps of a bake, each modified when it is read.

    Attributes
    ----------
    source : StoredMaps
        Source of the maps.
    alter : callable
        (index of the view, stored map) → modified map.
    """

    source: StoredMaps
    alter: Callable[[int, MapFile], MapFile]

    @classmethod
    def of(cls, source: StoredMaps, alter: Callable[[int, MapFile], MapFile]) -> AlteredMaps:
        """Make modified maps of a bake."""
        return cls(source.path, source.manifest, source, alter)

    def map(self, index: int) -> MapFile:
        """Read the map of one view, and modify it."""
        return self.alter(index, self.source.map(index))

    @property
    def light(self) -> Light:
        """Environment of the bake, unmodified."""
        return self.source.light

"""Maps with their manifest that are no bake on the disk: of a probe in memory, or altered as they are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.backend import Rendering
from rsibr.light.radiance import Light
from rsibr.store.manifest import Manifest
from rsibr.store.map_file import MapFile
from rsibr.store.stored_maps import StoredMaps


@dataclass(frozen=True, eq=False, repr=False)
class DescribedMaps:
    """All that a manifest says of its maps; the base of what holds them.

    Attributes
    ----------
    path : Path
        Where they lie, as errors name it.
    manifest : Manifest
        What they were made from, and with what.
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
        """Whether there are views all around; a bake whose lobes all have closed forms holds one map alone."""
        return len(self.manifest.triangles) > 0

    @property
    def resolution(self) -> int:
        """Texels along each side of a map."""
        return self.manifest.resolution

    @property
    def rendering(self) -> Rendering:
        """What was carried along a path; RGB in bakes older than plans."""
        return self.manifest.plan.rendering if self.manifest.plan else "rgb"

    @property
    def seconds(self) -> float:
        """Time that all views together took to bake [s]."""
        return self.manifest.whole_seconds

    @property
    def bytes(self) -> int:
        """Size of all maps together [bytes]."""
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


@dataclass(frozen=True, eq=False, repr=False)
class MapsInMemory(DescribedMaps):
    """Maps that were never written.

    Attributes
    ----------
    maps : tuple of MapFile
        One of each view of the manifest.
    light : Light
        The light that the model of each lobe is made from.
    """

    maps: tuple[MapFile, ...]
    light: Light

    def map(self, index: int) -> MapFile:
        """Return the map of one view."""
        return self.maps[index]


@dataclass(frozen=True, eq=False, repr=False)
class AlteredMaps(DescribedMaps):
    """The maps of a bake with something done to each of them as it is read.

    Attributes
    ----------
    source : StoredMaps
        Where they are read.
    alter : callable
        Makes the map of a view from its index and the map as it is stored.
    """

    source: StoredMaps
    alter: Callable[[int, MapFile], MapFile]

    @classmethod
    def of(cls, source: StoredMaps, alter: Callable[[int, MapFile], MapFile]) -> AlteredMaps:
        """Alter the maps of a bake."""
        return cls(source.path, source.manifest, source, alter)

    def map(self, index: int) -> MapFile:
        """Read the map of one view, and alter it."""
        return self.alter(index, self.source.map(index))

    @property
    def light(self) -> Light:
        """The light of the bake, as it is."""
        return self.source.light

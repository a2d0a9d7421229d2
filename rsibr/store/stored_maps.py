"""What a method reads of a bake: the same of one on disk, of maps in memory, and of a bake with altered maps."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rsibr.backend import Rendering
from rsibr.light.radiance import Light
from rsibr.store.manifest import Manifest
from rsibr.store.map_file import MapFile


class StoredMaps(Protocol):
    """Maps of stored views with their manifest and light; `Bake` is the one on disk, see there for each member."""

    @property
    def path(self) -> Path:
        """Directory, or a name that stands for it in messages."""
        ...

    @property
    def manifest(self) -> Manifest:
        """What the maps were made from."""
        ...

    @property
    def view_count(self) -> int:
        """Count of stored views."""
        ...

    @property
    def has_views(self) -> bool:
        """Whether there are views all around, with triangles between them."""
        ...

    @property
    def resolution(self) -> int:
        """Texels a side of a map."""
        ...

    @property
    def rendering(self) -> Rendering:
        """What was carried along a path."""
        ...

    @property
    def seconds(self) -> float:
        """Time that the bake took [s]."""
        ...

    @property
    def bytes(self) -> int:
        """Size of maps and light [bytes]."""
        ...

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit view vectors, shape (V, 3)."""
        ...

    @property
    def triangles(self) -> NDArray[np.int64]:
        """Triangulation of the directions, shape (M, 3)."""
        ...

    @property
    def light(self) -> Light:
        """The distant light."""
        ...

    def map(self, index: int) -> MapFile:
        """Map of one view."""
        ...

"""Protocol of a bake as methods read it: on disk, in memory, or with modified maps."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rsibr.backend import Rendering
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.light.radiance import Light
from rsibr.store.manifest import Manifest
from rsibr.store.map_file import MapFile


class StoredMaps(Protocol):
    """Maps of the stored views, with manifest and environment; `Bake` is the implementation on disk."""

    @property
    def path(self) -> Path:
        """Directory, or a name to show in messages."""
        ...

    @property
    def manifest(self) -> Manifest:
        """Manifest of the bake."""
        ...

    @property
    def view_count(self) -> int:
        """Number of stored views."""
        ...

    @property
    def has_views(self) -> bool:
        """Whether there are several views to blend, with triangles between them, or those of a capture."""
        ...

    @property
    def resolution(self) -> int:
        """Texels a side of a map."""
        ...

    @property
    def rendering(self) -> Rendering:
        """Rendering of the maps: "rgb", "spectral" or "spectral_polarized"."""
        ...

    @property
    def seconds(self) -> float:
        """Render time of all views together [s]."""
        ...

    @property
    def bytes(self) -> int:
        """Size of maps and environment [bytes]."""
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
    def viewpoints(self) -> Viewpoints:
        """Directions and triangles, which need not cover the sphere in a capture."""
        ...

    @property
    def light(self) -> Light:
        """Environment of the bake."""
        ...

    def map(self, index: int) -> MapFile:
        """Read the map of one view."""
        ...

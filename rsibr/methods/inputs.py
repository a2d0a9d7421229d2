"""What methods are made from: a bake's maps, views, light and lobes on the device, each made once and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.viewpoints import Viewpoints, first_views, from_directions, icosphere
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.store.layers import layer_of
from rsibr.store.lobe_shape import shape_of
from rsibr.store.manifest import LobeRecord
from rsibr.store.map_file import MapFile
from rsibr.store.stored_maps import StoredMaps

Array = NDArray[np.float64]
_T = TypeVar("_T")


@dataclass(eq=False)
class SharedTime:
    """Time of shared inputs, noted while something used them.

    Attributes
    ----------
    seconds : dict of str to float
        What each input took when it was made.
    seconds_here : float
        Of them, what was spent while watched.
    used : set of str
        Inputs that were used while watched.
    """

    seconds: dict[str, float]
    seconds_here: float = 0.0
    used: set[str] = field(default_factory=set)

    @property
    def seconds_ever(self) -> float:
        """Time of all that was used, whenever it was made."""
        return sum(self.seconds[name] for name in self.used)


def shared(make: Callable[[Any], _T]) -> _T:
    """Property that is made at its first use, timed, and kept: as `functools.cached_property`, with a clock."""

    def get(self: MethodInputs) -> _T:
        return self._get(make.__name__, make)

    return property(get, doc=make.__doc__)  # type: ignore[return-value]  # to the reader an attribute


class MethodInputs:
    """All that a method may read of a bake.

    Parameters
    ----------
    bake : StoredMaps
        The bake. Nothing is read before it is used.
    """

    def __init__(self, bake: StoredMaps) -> None:
        self.bake = bake
        self._kept: dict[str, Any] = {}
        self._seconds: dict[str, float] = {}
        self._uses: dict[str, set[str]] = {}
        self._nested = 0.0
        self._watching: list[SharedTime] = []

    @property
    def lobes(self) -> tuple[LobeRecord, ...]:
        """Records of the lobes that are kept apart."""
        return self.bake.manifest.lobes

    @shared
    def maps(self) -> list[MapFile]:
        """Stored maps, decoded once."""
        return [self.bake.map(index) for index in range(self.bake.view_count)]

    @shared
    def sources(self) -> SourceMaps:
        """Radiance of all stored maps on the device."""
        return self.on_device([m.radiance for m in self.maps])

    @shared
    def viewpoints(self) -> Viewpoints:
        """Stored directions and triangles; where one map was enough, any will do: nothing is looked up between."""
        bake = self.bake
        return from_directions(bake.directions, bake.triangles) if bake.has_views else icosphere(0)

    @shared
    def light(self) -> Light:
        """The distant light."""
        return self.bake.light

    @shared
    def pyramid(self) -> EnvironmentPyramid:
        """Gaussian pyramid of the light on the device; its finest level alone where no lobe is glossy."""
        if any(not shape.is_matte and not shape.is_mirror for shape, _ in self.shapes.values()):
            return EnvironmentPyramid.of(self.light.picture, self.light.levels)
        return EnvironmentPyramid.finest_only(self.light.picture)

    @shared
    def shapes(self) -> dict[str, tuple[LobeShape, Array]]:
        """Shape and directional albedo, shape (NODES, 3), of each lobe."""
        return {record.name: (shape_of(record), np.array(record.albedo)) for record in self.lobes}

    def stored(self, lobe: str | None = None) -> list[MapFile]:
        """Maps that have a layer of a lobe, the first so many of all; all of them for the sum of the lobes."""
        return self.maps[: self.stored_count(lobe)]

    def stored_count(self, lobe: str | None = None) -> int:
        """Count of the maps that `stored` returns; KeyError where there is no such lobe."""
        views = None if lobe is None else {record.name: record.views for record in self.lobes}[lobe]
        return views or self.bake.view_count

    def image(self, map_file: MapFile, lobe: str | None = None) -> NDArray[np.float32]:
        """Radiance of a lobe in a stored map, or of their sum; shape (N, N, 3)."""
        return map_file.layers[layer_of(lobe, self.lobes)] if lobe else map_file.radiance

    def first_views(self, count: int) -> Viewpoints:
        """The first `count` of the stored views, with triangles of their own."""
        return first_views(self.viewpoints, count) if self.bake.has_views else self.viewpoints

    def on_device(self, images: list[NDArray[np.float32]]) -> SourceMaps:
        """Put one image of each of the first views on the device, each of shape (N, N, 3)."""
        seen = self.maps[: len(images)]
        coverage, frames = (np.stack([getattr(m, part) for m in seen]) for part in ("coverage", "frame"))
        return SourceMaps.from_arrays(np.stack(images), coverage, frames)

    @contextmanager
    def watched(self) -> Iterator[SharedTime]:
        """Note which shared inputs are used in the block, and the time of those that are made in it."""
        watch = SharedTime(self._seconds)
        self._watching.append(watch)
        try:
            yield watch
        finally:
            self._watching.remove(watch)

    def _get(self, name: str, make: Callable[[Any], _T]) -> _T:
        if name not in self._kept:
            self._make(name, make)
        for watch in self._watching:
            watch.used |= self._uses[name]
        value: _T = self._kept[name]
        return value

    def _make(self, name: str, make: Callable[[Any], Any]) -> None:
        outer, self._nested = self._nested, 0.0
        with backend.session(), self.watched() as inner:
            start = time.perf_counter()
            self._kept[name] = make(self)
            backend.synchronize()
            whole = time.perf_counter() - start
        self._uses[name] = inner.used | {name}
        self._seconds[name] = whole - self._nested  # what an input needs of another counts there
        self._nested = outer + whole
        for watch in self._watching:
            watch.seconds_here += self._seconds[name]

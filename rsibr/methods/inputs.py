"""Inputs of methods: maps, views, environment and lobes of a bake on the device, each made once and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.viewpoints import Viewpoints, first_views, icosphere
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.one_channel import in_one_channel
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
    """Preparation time of the shared inputs used in a `MethodInputs.watched` block.

    Attributes
    ----------
    seconds : dict of str to float
        Time to make each input [s].
    seconds_here : float
        Time spent on inputs that were made inside the block [s].
    used : set of str
        Inputs used inside the block.
    """

    seconds: dict[str, float]
    seconds_here: float = 0.0
    used: set[str] = field(default_factory=set)

    @property
    def seconds_ever(self) -> float:
        """Time of all inputs used in the block, whenever they were made [s]."""
        return sum(self.seconds[name] for name in self.used)


def shared(make: Callable[[Any], _T]) -> _T:
    """Decorate a property so that it is made at first use, timed, and cached (a timed `functools.cached_property`)."""

    def get(self: MethodInputs) -> _T:
        return self._get(make.__name__, make)

    return property(get, doc=make.__doc__)  # type: ignore[return-value]  # used as an attribute


class MethodInputs:
    """Parts of a bake that methods read.

    Parameters
    ----------
    bake : StoredMaps
        The bake. Each part is read at its first use.

    Attributes
    ----------
    learnt : dict
        What methods learn from the stored maps and want to share between their variants.
    """

    def __init__(self, bake: StoredMaps) -> None:
        self.bake = bake
        self._kept: dict[str, Any] = {}
        self._seconds: dict[str, float] = {}
        self._uses: dict[str, set[str]] = {}
        self._nested = 0.0
        self._watching: list[SharedTime] = []
        self.learnt: dict[Any, Any] = {}

    @property
    def is_grey(self) -> bool:
        """Whether the maps hold one channel (`effects.colour` off): light and lobes then have their red one for all."""
        plan = self.bake.manifest.plan
        return plan is not None and plan.grey

    @cached_property
    def lobes(self) -> tuple[LobeRecord, ...]:
        """Records of the lobes that are stored separately; in one channel where the maps are."""
        lobes = self.bake.manifest.lobes
        return tuple(map(in_one_channel, lobes)) if self.is_grey else lobes

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
        """Stored directions and triangles; the icosahedron as a placeholder in a bake with a single map."""
        return self.bake.viewpoints if self.bake.has_views else icosphere(0)

    @shared
    def light(self) -> Light:
        """Environment of the bake; in one channel where the maps are."""
        return self.bake.light.in_one_channel() if self.is_grey else self.bake.light

    @shared
    def pyramid(self) -> EnvironmentPyramid:
        """Gaussian pyramid of the environment on the device; only its finest level where no lobe has Gaussians."""
        if any(shape.has_gaussians for shape, _ in self.shapes.values()):
            return EnvironmentPyramid.of(self.light.picture, self.light.levels)
        return EnvironmentPyramid.finest_only(self.light.picture)

    @shared
    def shapes(self) -> dict[str, tuple[LobeShape, Array]]:
        """Shape of each lobe, and its directional albedo as an array of shape (NODES, 3)."""
        return {record.name: (shape_of(record), np.array(record.albedo)) for record in self.lobes}

    def stored(self, lobe: str | None = None) -> list[MapFile]:
        """Return the maps with a layer of `lobe` (the first `stored_count(lobe)` views); all maps for None."""
        return self.maps[: self.stored_count(lobe)]

    def stored_count(self, lobe: str | None = None) -> int:
        """Return the number of maps with a layer of `lobe`; raises KeyError if there is no such lobe."""
        views = None if lobe is None else {record.name: record.views for record in self.lobes}[lobe]
        return views or self.bake.view_count

    def image(self, map_file: MapFile, lobe: str | None = None) -> NDArray[np.float32]:
        """Radiance of a lobe in a stored map, or of the sum of all lobes; shape (N, N, 3)."""
        return map_file.layers[layer_of(lobe, self.lobes)] if lobe else map_file.radiance

    def first_views(self, count: int) -> Viewpoints:
        """Return the first `count` stored views, with their own triangulation."""
        return first_views(self.viewpoints, count) if self.bake.has_views else self.viewpoints

    def on_device(self, images: list[NDArray[np.float32]]) -> SourceMaps:
        """Put one image of shape (N, N, 3) for each of the first views on the device."""
        seen = self.maps[: len(images)]
        coverage, frames = (np.stack([getattr(m, part) for m in seen]) for part in ("coverage", "frame"))
        return SourceMaps.from_arrays(np.stack(images), coverage, frames)

    def made(self, names: Iterable[str]) -> list[Any]:
        """Return shared inputs that were made already."""
        return [self._kept[name] for name in names]

    @contextmanager
    def watched(self) -> Iterator[SharedTime]:
        """Record which shared inputs are used in the block, and the time of those made in it."""
        watch = SharedTime(self._seconds)
        self._watching.append(watch)
        try:
            yield watch
        finally:
            self._watching.remove(watch)

    def _get(self, name: str, make: Callable[[Any], _T]) -> _T:
        with backend.session():  # one thread at a time makes an input
            if name not in self._kept:
                self._make(name, make)
            for watch in self._watching:
                watch.used |= self._uses[name]
            value: _T = self._kept[name]
            return value

    def _make(self, name: str, make: Callable[[Any], Any]) -> None:
        outer, self._nested = self._nested, 0.0
        with self.watched() as inner:
            start = time.perf_counter()
            self._kept[name] = make(self)
            backend.synchronize()
            whole = time.perf_counter() - start
        self._uses[name] = inner.used | {name}
        self._seconds[name] = whole - self._nested  # without the inputs it uses, which are timed themselves
        self._nested = outer + whole
        for watch in self._watching:
            watch.seconds_here += self._seconds[name]

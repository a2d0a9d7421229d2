"""Maps that are published: stored ones as they were rendered, or those of a method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.job_size import JobSize
from rsibr.lobes.basis import LAMBERT
from rsibr.methods.job import OUTPUT_BYTES, maps_memory
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import default_method, registration
from rsibr.publishing.published_view import DIFFUSE, SPECULAR, Image, PublishedView
from rsibr.store.layers import layers_at
from rsibr.store.stored_maps import StoredMaps

ALL = "all"
"""In place of views: all stored ones."""

STORED = "the stored map"
"""Source of a map that was rendered for its view."""

LEAST, MOST = 8, 4096
"""Limits of texels a side of a sphere map."""


@dataclass(frozen=True, eq=False)
class ViewSource:
    """Views of a bake, and what shows them.

    Attributes
    ----------
    bake : StoredMaps
        The bake.
    directions : ndarray, shape (V, 3)
        Unit views.
    names : list of str
        Name of each view; a single empty one for a view without a number.
    method : str or None
        Name of the method; None for the stored maps.
    resolution : int
        Texels a side of the sphere maps.
    split : bool
        Whether views come with their passes, where they are known.
    notes : tuple of str
        What a user should know.
    """

    bake: StoredMaps
    directions: NDArray[np.float64]
    names: list[str]
    method: str | None
    resolution: int
    split: bool
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, bake: StoredMaps, views: str | ArrayLike, method: str | None, resolution: int | None, *, split: bool
    ) -> ViewSource:
        """Decide where the maps of `views` come from.

        Parameters
        ----------
        bake : StoredMaps
            The bake.
        views : "all" or array_like, shape (3,) or (V, 3)
            Directions from the surface to the viewer.
        method, resolution
            As of `rsibr.publishing.publish.publish`.
        split : bool
            Whether a format needs the passes of a view.

        Raises
        ------
        InputError
            If a view has no direction, the method is unknown or the resolution out of range.
        """
        if resolution is not None and not LEAST <= resolution <= MOST:
            raise InputError(f"{resolution} texels", where="resolution", fix=f"give {LEAST} to {MOST}")
        notes: tuple[str, ...] = ()
        side = resolution or bake.resolution
        if isinstance(views, str):
            directions, names = _stored_views(bake, views)
            stored = method is None and side == bake.resolution
            if stored and split and not all(_kinds_apart(bake, index) for index in range(bake.view_count)):
                notes = (
                    ("some stored maps hold lobes added up: the maps are those of a method",) if _knows(bake) else ()
                )
                stored = not notes
        else:
            directions, names, stored = *_asked_views(views), False
        chosen = None if stored else method or default_method(bake)
        if chosen is not None:
            registration(chosen)  # an unknown one is an error before anything is read
        return cls(bake, directions, names, chosen, side, split, notes)

    def admit(self, allow_large: bool) -> None:
        """Raise an InputError if the maps exceed the free memory, unless `allow_large`."""
        maps = 0 if self.method is None else maps_memory(self.bake)
        JobSize(f"publication at {self.resolution}²", memory=maps + 4 * OUTPUT_BYTES * self.resolution**2).admit(
            None, allow_large
        )

    def view(self, index: int, stem: str) -> PublishedView:
        """Make one view; `stem` begins the names of its files.

        Raises
        ------
        InputError
            If its map is not finite.
        BakeError
            If the bake lacks something that the method requires.
        """
        told = self.bake.manifest
        frame, name = view_frame(self.directions[index]), self.names[index]
        image, coverage, passes = self._stored(index) if self.method is None else self._made(self.method, frame)
        scene, source = f"{told.material.name} under {told.environment.name}", self.method or STORED
        return PublishedView(stem, name, scene, source, frame, image, coverage, passes)

    def _stored(self, index: int) -> tuple[Image, Image, dict[str, Image]]:
        found = self.bake.map(index)
        inside = (found.coverage > 0)[..., None]
        layers = layers_at(self.bake.manifest.lobes, index)
        passes: dict[str, Image] = {}
        if self.split and _kinds_apart(self.bake, index):
            kinds = {layer: self._kind(members[0]) for layer, members in layers.items()}
            passes = _grouped(found.layers, kinds, inside)
        return np.where(inside, found.radiance, np.float32(0)), found.coverage, passes

    def _made(self, method: str, frame: NDArray[np.float64]) -> tuple[Image, Image, dict[str, Image]]:
        whole = run(self._methods[method], frame, self.resolution)
        lobes = [lobe.name for lobe in self.bake.manifest.lobes]
        passes: dict[str, Image] = {}
        if self.split and len(lobes) == 1:
            passes = _grouped({lobes[0]: whole.image}, {lobes[0]: self._kind(lobes[0])}, True)
        elif self.split and lobes and "lobe" in registration(method).options:
            images = {
                lobe: run(self._methods.variant(method, lobe=lobe), frame, self.resolution).image for lobe in lobes
            }
            passes = _grouped(images, {lobe: self._kind(lobe) for lobe in lobes}, True)
        return whole.image, whole.coverage.astype(np.float32), passes

    @cached_property
    def _methods(self) -> MethodSet:
        return MethodSet(self.bake)

    def _kind(self, lobe: str) -> str:
        return _kind_of(self.bake, lobe)


def _stored_views(bake: StoredMaps, views: str) -> tuple[NDArray[np.float64], list[str]]:
    if views != ALL:
        raise InputError(f"'{views}' is no view", where="views", fix=f"give a direction, or '{ALL}'")
    return bake.directions, [f"view_{index:04d}" for index in range(bake.view_count)]


def _asked_views(views: ArrayLike) -> tuple[NDArray[np.float64], list[str]]:
    try:
        asked = np.asarray(views, np.float64)
    except (TypeError, ValueError):
        raise InputError("they are no directions", where="views", fix="give three numbers, or rows of three") from None
    if asked.ndim == 1:
        return unit_view(asked)[None], [""]
    if asked.ndim != 2 or not len(asked):
        raise InputError("they are no directions", where="views", fix="give three numbers, or rows of three")
    return np.array([unit_view(one) for one in asked]), [f"asked_{index:04d}" for index in range(len(asked))]


def _kind_of(bake: StoredMaps, lobe: str) -> str:
    """Pass of a lobe."""
    alpha = next(record.alpha for record in bake.manifest.lobes if record.name == lobe)
    return DIFFUSE if alpha == LAMBERT else SPECULAR


def _kinds_apart(bake: StoredMaps, index: int) -> bool:
    """Whether each layer of a stored map holds lobes of one pass only."""
    layers: Sequence[list[str]] = list(layers_at(bake.manifest.lobes, index).values())
    return bool(bake.manifest.lobes) and all(len({_kind_of(bake, lobe) for lobe in one}) == 1 for one in layers)


def _knows(bake: StoredMaps) -> bool:
    """Whether the default method evaluates single lobes of the bake."""
    return bool(bake.manifest.lobes) and "lobe" in registration(default_method(bake)).options


def _grouped(images: dict[str, Image], kinds: dict[str, str], inside: NDArray[np.bool_] | bool) -> dict[str, Image]:
    """Sum of the images of each pass; zero where there is none."""
    passes = {kind: np.zeros_like(next(iter(images.values()))) for kind in (DIFFUSE, SPECULAR)}
    for name, image in images.items():
        passes[kinds[name]] = passes[kinds[name]] + np.where(inside, image, np.float32(0))
    return passes

"""Filters: means of a map over a patch, by name. A filter registers itself in its own file."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Protocol

import mitsuba as mi

from rsibr.errors import InputError, did_you_mean
from rsibr.registered import import_all
from rsibr.shading.maps.indexing import Patch
from rsibr.shading.maps.view_maps import ViewMaps

Reader = Callable[["mi.UInt32", "Patch"], "mi.Color3f"]
"""(map, patch) → mean radiance of the map over the patch; patches without corners are points."""


class MapFilter(Protocol):
    """Filter of maps.

    Attributes
    ----------
    summary : str
        Description in one line.
    needs_footprint : bool
        Whether it reads the corners of patches.
    has_levels : bool
        Whether it reads MIP levels.
    """

    summary: str
    needs_footprint: bool
    has_levels: bool

    def reader(self, maps: ViewMaps) -> Reader:
        """Prepare the maps of a picture."""
        ...


def over_patches(maps: ViewMaps, mean: Reader) -> Reader:
    """Reader that takes the mean over patches with corners, and a bilinear lookup at points."""

    def read(index: mi.UInt32, patch: Patch) -> mi.Color3f:
        return maps.fetch(index, patch.middle) if patch.corners is None else mean(index, patch)

    return read


_REGISTERED: dict[str, MapFilter] = {}


def register_filter(name: str, kind: Callable[[], MapFilter]) -> None:
    """Register a filter under its name."""
    _REGISTERED[name] = kind()


def filters() -> dict[str, MapFilter]:
    """All filters by name."""
    _discover()
    return dict(_REGISTERED)


def filter_named(name: str) -> MapFilter:
    """Filter `name`.

    Raises
    ------
    InputError
        If no filter has this name.
    """
    known = filters()
    if name not in known:
        there = f"there are: {', '.join(known)}"
        raise InputError(f"unknown filter '{name}'", where="filter", fix=did_you_mean(name, known) + there)
    return known[name]


@cache
def _discover() -> None:
    import_all("rsibr.shading.maps.filters")

"""Filters: means of a map over a patch, by name. A filter registers itself in its own file."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from difflib import get_close_matches
from functools import cache
from typing import Protocol

import mitsuba as mi

from rsibr.errors import InputError
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
        near = get_close_matches(name, known, 1)
        meant = f"did you mean '{near[0]}'? " if near else ""
        raise InputError(f"unknown filter '{name}'", where="filter", fix=f"{meant}there are: {', '.join(known)}")
    return known[name]


@cache
def _discover() -> None:
    package = importlib.import_module("rsibr.shading.maps.filters")
    for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        importlib.import_module(module.name)

"""Registry of lookups: how the radiance of a surface is taken from a method, by name.

A lookup registers itself in its own file, below `rsibr/shading/lookups/`; no other file refers to it by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol, TypeVar

import mitsuba as mi

from rsibr.errors import InputError, did_you_mean
from rsibr.registered import import_all, keyword_options
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.surfaces import Surfaces

Shade = Callable[["Surfaces"], "mi.Color3f"]
"""Reflected radiance [W sr⁻¹ m⁻²] of surfaces, one a lane; traced inside the kernel of a picture."""


class Lookup(Protocol):
    """Radiance of the surfaces of one type from one method.

    Attributes
    ----------
    needs_footprint : bool
        Whether its pictures need `Surfaces.footprint`. Without it, a lookup shades points.
    """

    @property
    def needs_footprint(self) -> bool:
        """See above."""
        ...

    def toward(self, camera: Camera) -> Shade:
        """Prepare a picture: reconstruct the maps that it needs, and return the function that shades its surfaces.

        All arrays that the function reads are evaluated when it is returned.
        """
        ...


LookupFactory = Callable[..., "Lookup"]
_F = TypeVar("_F", bound=LookupFactory)

_REGISTERED: dict[str, LookupRegistration] = {}


@dataclass(frozen=True)
class LookupRegistration:
    """Entry of the registry.

    Attributes
    ----------
    name : str
        Name on the command line.
    summary : str
        Description in one line.
    make : callable
        (method, scene) → `Lookup`. Its keyword-only parameters are the lookup's options.
    """

    name: str
    summary: str
    make: LookupFactory

    @property
    def options(self) -> dict[str, Any]:
        """Keyword parameters of `make` with their defaults, such as `filter`, `resolution`."""
        return keyword_options(self.make)

    def checked(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Return options if the lookup has them all.

        Raises
        ------
        InputError
            If it has not.
        """
        for name in options:
            if name not in self.options:
                there = ", ".join(self.options) or "none"
                raise InputError(f"no option '{name}'", where=f"lookup '{self.name}'", fix=f"there are: {there}")
        return dict(options)


def register_lookup(name: str, *, summary: str) -> Callable[[_F], _F]:
    """Register a lookup; decorates its class, or a function that makes it."""

    def decorate(make: _F) -> _F:
        _REGISTERED[name] = LookupRegistration(name, summary, make)
        return make

    return decorate


def lookups() -> dict[str, LookupRegistration]:
    """All lookups by name."""
    _discover()
    return dict(_REGISTERED)


def lookup_named(name: str) -> LookupRegistration:
    """Registration of the lookup `name`.

    Raises
    ------
    InputError
        If no lookup has this name.
    """
    known = lookups()
    if name not in known:
        there = f"there are: auto, {', '.join(known)}"
        raise InputError(f"unknown lookup '{name}'", where="lookup", fix=did_you_mean(name, known) + there)
    return known[name]


@cache
def _discover() -> None:
    """Import every module of this package, once; each registers its lookup."""
    import_all("rsibr.shading.lookups")

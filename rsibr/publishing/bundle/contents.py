"""What the methods of a page need of a bake: each system registers a function that makes its part of a bundle."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from rsibr.methods.method_set import MethodSet
from rsibr.publishing.bundle.encoding import Encoded, Precision
from rsibr.registered import import_all

SIZES = (128, 256, 512, 1024)
"""Texels a side of the maps that a page makes, beside those of the bake."""


@dataclass(frozen=True, eq=False)
class Request:
    """A bake and how it is to be bundled.

    Attributes
    ----------
    methods : MethodSet
        Methods of the bake.
    precision : {"half", "float"}
        Numbers of radiance maps.
    light_size : int or None
        Texels a side of the environment's octahedral image; as its methods ask by default.
    sizes : tuple of int
        Texels a side of the maps that the page makes.
    """

    methods: MethodSet
    precision: Precision
    light_size: int | None
    sizes: tuple[int, ...]


@dataclass(eq=False)
class Part:
    """One system's part of a bundle: numbers and names as JSON holds them, and arrays."""

    meta: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, Encoded] = field(default_factory=dict)


MakePart = Callable[[Request], Part]

_PARTS: dict[str, MakePart] = {}
_USED_BY: dict[str, tuple[str, ...]] = {}


def contributes(name: str, *, to: Iterable[str] = ()) -> Callable[[MakePart], MakePart]:
    """Register the function that makes the part `name` of a bundle, which the methods `to` read; by default all."""

    def decorate(make: MakePart) -> MakePart:
        _PARTS[name], _USED_BY[name] = make, tuple(to)
        return make

    return decorate


def drawn() -> tuple[str, ...]:
    """Names of the methods that a page can draw."""
    _discover()
    return tuple({method: None for used in _USED_BY.values() for method in used})


def parts_of(methods: Iterable[str]) -> dict[str, MakePart]:
    """Parts that these methods read, each with the function that makes it."""
    _discover()
    wanted = set(methods)
    return {name: make for name, make in _PARTS.items() if not _USED_BY[name] or wanted & set(_USED_BY[name])}


@cache
def _discover() -> None:
    import_all("rsibr.publishing.bundle.tables")

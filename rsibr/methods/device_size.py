"""Memory that a method's arrays take on the device."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import drjit as dr


def device_bytes(root: object) -> int:
    """Total size of all Dr.Jit arrays reachable from an object, each counted once [bytes].

    Parameters
    ----------
    root : object
        Its attributes are searched, and in them the fields of dataclasses, mappings, lists and tuples; other objects
        are not.
    """
    return sum(dict(_arrays(getattr(root, "__dict__", root), set())).values())


def _arrays(value: Any, seen: set[int]) -> Iterator[tuple[int, int]]:
    if id(value) in seen or isinstance(value, str | bytes | int | float | bool | type(None)):
        return
    seen.add(id(value))
    if dr.is_array_v(value):
        yield from _components(value)
    elif is_dataclass(value) and not isinstance(value, type):
        for one in fields(value):
            yield from _arrays(getattr(value, one.name, None), seen)
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _arrays(item, seen)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _arrays(item, seen)


def _components(array: Any) -> Iterator[tuple[int, int]]:
    """Index and size of each flat array of a (nested) Dr.Jit array."""
    if dr.depth_v(array) > 1:
        for item in array:
            yield from _components(item)
    elif dr.is_jit_v(array):
        yield array.index, dr.width(array) * dr.itemsize_v(array)

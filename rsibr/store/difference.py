"""Differences between two bakes, for error messages."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from rsibr.store.atomic import checksum
from rsibr.store.manifest import Manifest, canonical

_ABSENT = object()
_MAXIMUM = 8
_LONGEST_VALUE = 60


def differences(found: Manifest, wanted: Manifest) -> list[str]:
    """List the keys whose values prevent the bake `found` from being resumed as `wanted`.

    Returns
    -------
    list of str
        Entries such as "sampling.samples: 64 → 128", at most eight and the number of the others; empty if the two bakes
        are bit-identical.
    """
    return changes(_fixing_the_bits(found), _fixing_the_bits(wanted))


def bits_digest(manifest: Manifest) -> str:
    """SHA-256 of everything that determines the bits of the maps: equal for bakes without `differences`."""
    return checksum(canonical(_fixing_the_bits(manifest)))


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """List the values that differ in two tables, by dotted key; see `differences`.

    Parameters
    ----------
    old, new : mapping
        JSON data; tables may be nested.
    """
    old, new = dict(_flatten(old)), dict(_flatten(new))
    keys = [key for key in dict.fromkeys([*old, *new]) if old.get(key, _ABSENT) != new.get(key, _ABSENT)]
    # Keys of the config are shown as in TOML and in --set
    shown = [
        f"{key.removeprefix('config.')}: {_show(old.get(key, _ABSENT))} → {_show(new.get(key, _ABSENT))}"
        for key in keys[:_MAXIMUM]
    ]
    hidden = len(keys) - len(shown)
    return [*shown, f"and {hidden} more"] if hidden else shown


def _fixing_the_bits(manifest: Manifest) -> dict[str, Any]:
    """Values that two bakes must share for one to be resumed as the other, by dotted key."""
    geometry = [manifest.directions, manifest.triangles]
    return {
        **dict(_flatten(manifest.identity)),
        "config.map.resolution": manifest.resolution,  # the same key as in the identity
        "number of views": len(manifest.directions),
        "directions and triangles": checksum(canonical(geometry)),
    }


def _flatten(value: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, item in value.items():
        if isinstance(item, Mapping) and item:
            yield from _flatten(item, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", item


def _show(value: object) -> str:
    if value is _ABSENT:
        return "absent"
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    if re.fullmatch("[0-9a-f]{64}", text):
        return text[:12]  # a digest: twelve digits identify it
    return text if len(text) <= _LONGEST_VALUE else f"…{text[1 - _LONGEST_VALUE :]}"

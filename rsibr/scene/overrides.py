"""Overrides from the command line: `--set a.b=value`, applied to the tables of a config."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from rsibr.errors import InputError

ALTERNATIVES: Mapping[str, tuple[str, ...]] = {
    "environment": ("file", "faces", "emitter"),
    "material": ("preset", "bsdf", "file"),
    "views": ("subdivision", "file"),
    "sampling": ("samples", "target_error", "time_budget_s"),
    "budget": ("error", "seconds"),
}
"""Mutually exclusive keys of each section: an override of one removes the others from the config."""


class OverrideText(str):
    """Text of an override: where it is a path, it starts at the working folder and not at that of the config."""


def path_start(path: str, base: Path | str) -> Path:
    """Folder at which a relative path of a config starts: `base`, that of the config; of an override, where one is."""
    return Path.cwd() if isinstance(path, OverrideText) else Path(base)


def apply_overrides(data: Mapping[str, Any], overrides: Sequence[str]) -> dict[str, Any]:
    """Apply overrides to the tables of a config.

    Parameters
    ----------
    data : mapping
        The config as parsed from TOML; not modified.
    overrides : sequence of str
        `a.b=value`, with the value in TOML; a bare word that is not TOML is taken as a string.

    Returns
    -------
    dict
        The config with the overrides, their texts as `OverrideText`. An override of one of the `ALTERNATIVES` removes
        the others of the config; if two of them are overridden, both remain, and validation of the config rejects them.

    Raises
    ------
    InputError
        If an override has no `=` or no key, its value is an unclosed string, list or table, or its key leads through a
        value that is not a table.

    Examples
    --------
    >>> apply_overrides({"map": {"resolution": 64}}, ["map.resolution=128", "views.subdivision=1"])
    {'map': {'resolution': 128}, 'views': {'subdivision': 1}}
    """
    parsed = [(text, *parse_override(text)) for text in overrides]
    return _laid_over(data, parsed)


def with_values(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a config with the values of dotted keys, as `apply_overrides` does with `a.b=value`."""
    return _laid_over(data, [(key, tuple(key.split(".")), value) for key, value in values.items()])


def override_keys(overrides: Sequence[str]) -> set[str]:
    """Return the dotted keys that the overrides set."""
    return {".".join(parse_override(text)[0]) for text in overrides}


def _laid_over(data: Mapping[str, Any], placed: Sequence[tuple[str, tuple[str, ...], Any]]) -> dict[str, Any]:
    result = deepcopy(dict(data))
    for _, keys, _ in placed:
        _drop_alternatives(result, keys)
    for text, keys, value in placed:
        _place(result, keys, value, text)
    return result


def parse_override(text: str) -> tuple[tuple[str, ...], Any]:
    """Key and value of `a.b=value`; see `apply_overrides`."""
    dotted, equals, value = text.partition("=")
    keys = tuple(key.strip() for key in dotted.split("."))
    if not equals or not all(keys):
        raise InputError(
            f"'{text}' sets nothing",
            where="overrides",
            fix="write it as map.resolution=128",
        )
    return keys, _value(value.strip(), text)


def _value(text: str, whole: str) -> Any:
    try:
        table = tomllib.loads(f"value = {text}")
    except ValueError as error:  # also raised for integers of thousands of digits
        if text[:1] in ("{", "[", '"', "'"):
            reason = str(error).partition(" (at")[0]
            raise InputError(f"'{whole}' is not valid TOML: {reason}", where="overrides") from None
        return OverrideText(text)
    if set(table) != {"value"}:
        raise InputError(
            f"'{whole}' holds more than one value", where="overrides", fix="give one KEY=VALUE for each key"
        )
    # A file name may look like a date, and no value in a config is a date
    return _marked(text if isinstance(table["value"], date | time | datetime) else table["value"])


def _marked(value: Any) -> Any:
    """Mark all texts of a value, nested ones too."""
    if isinstance(value, str):
        return OverrideText(value)
    if isinstance(value, list):
        return [_marked(item) for item in value]
    return {key: _marked(item) for key, item in value.items()} if isinstance(value, dict) else value


def _drop_alternatives(data: dict[str, Any], keys: tuple[str, ...]) -> None:
    section = data.get(keys[0])
    if len(keys) < 2 or not isinstance(section, dict):
        return
    rivals = ALTERNATIVES.get(keys[0], ())
    if keys[1] in rivals:
        for rival in rivals:
            if rival != keys[1]:
                section.pop(rival, None)


def _place(data: dict[str, Any], keys: tuple[str, ...], value: Any, text: str) -> None:
    table = data
    for depth, key in enumerate(keys[:-1], start=1):
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise InputError(f"'{text}': {'.'.join(keys[:depth])} is not a table", where="overrides")
    table[keys[-1]] = value

"""Error messages for invalid configs: one phrase an error, made from pydantic's report."""

from __future__ import annotations

import difflib
import json
from collections.abc import Collection
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

_LONGEST = 200
"""Largest number of characters, or of an integer's bits, that a message shows of a value."""


def describe(error: ValidationError, model: type[BaseModel], overridden: Collection[str] = ()) -> list[str]:
    """Describe each error in a config.

    Parameters
    ----------
    error : ValidationError
        Pydantic's report.
    model : type
        The model that was validated; an unknown key is compared with its field names.
    overridden : collection of str
        Dotted keys that came from `--set`; messages about them say so.

    Returns
    -------
    list of str
        For each error the dotted key, the value, and the allowed values or the nearest known key.
    """
    known = known_keys(model)
    return [_phrase(dict(entry), known, overridden) for entry in error.errors(include_url=False)]


def _phrase(entry: dict[str, Any], known: list[str], overridden: Collection[str]) -> str:
    key = ".".join(str(part) for part in entry["loc"])
    origin = " (from --set)" if key in overridden else ""
    match entry["type"]:
        case "extra_forbidden":
            return f"unknown key '{key}'{origin}: {_suggestion(key, known)}"
        case "missing":
            return f"the key '{key}' is missing"
        case "model_type":
            return f"{key} should be a table{origin}"
    value = entry["input"]
    shown = f" = {_shortened(value)}" if isinstance(value, str | int | float) else ""
    message = entry["msg"].removeprefix("Value error, ").replace("Input should", "should")
    return f"{key}{shown}{origin}{'' if shown else ':'} {message}"


def _shortened(value: str | float) -> str:
    if isinstance(value, int) and value.bit_length() > _LONGEST:  # Python refuses to convert very long integers
        return f"an integer of {value.bit_length()} bits"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _suggestion(key: str, known: list[str]) -> str:
    parent, _, leaf = key.rpartition(".")
    prefix = f"{parent}." if parent else ""
    siblings = [name.removeprefix(prefix) for name in known if name.rpartition(".")[0] == parent]
    near = difflib.get_close_matches(leaf, siblings, n=1)
    elsewhere = [name for name in known if name.endswith(f".{leaf}")]
    if elsewhere:
        return f"did you mean '{elsewhere[0]}'?"
    if near:
        return f"did you mean '{prefix}{near[0]}'?"
    return f"known here: {', '.join(siblings)}"


def known_keys(model: type[BaseModel]) -> list[str]:
    """Dotted keys of a model and of its sections."""
    names: list[str] = []
    for attribute, field in model.model_fields.items():
        name = field.alias or attribute
        names.append(name)
        for kind in (field.annotation, *get_args(field.annotation)):  # the section itself, or one that may be absent
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                names += [f"{name}.{inner}" for inner in known_keys(kind)]
    return names

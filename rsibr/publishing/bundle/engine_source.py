"""Source of the engine as one classic script: its files, its shaders, and the constants that both take from Python."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from rsibr.publishing.bundle.bundle import FORMAT
from rsibr.publishing.bundle.constants import constants, glsl

_WEB = files("rsibr.publishing") / "web"


@cache
def engine_script() -> str:
    """Return the JavaScript of the engine, to be put into a page as it is; it defines the global `rsibr`.

    Examples
    --------
    >>> "</script" in engine_script()
    False
    """
    shaders = {
        "constants": glsl(constants()),
        **{_stem(one): one.read_text(encoding="utf-8") for one in _found(_WEB / "shaders", ".glsl")},
    }
    code = [one.read_text(encoding="utf-8") for one in _found(_WEB / "engine", ".js")]
    head = f"""globalThis.rsibr = globalThis.rsibr || {{}};
rsibr.FORMAT = {FORMAT};
rsibr.constants = {json.dumps(constants())};
rsibr.shaders = {json.dumps(shaders)};
"""
    return "\n".join([head, *code]).replace("</", "<\\/")


def _found(folder: Traversable, ending: str) -> list[Traversable]:
    """Files below a folder, by name; a folder's own files go before those of the folders in it."""
    inside = sorted(folder.iterdir(), key=lambda one: (one.is_dir(), one.name))
    found: list[Traversable] = []
    for one in inside:
        found += _found(one, ending) if one.is_dir() else [one] if one.name.endswith(ending) else []
    return found


def _stem(file: Traversable) -> str:
    return file.name.removesuffix(".glsl")

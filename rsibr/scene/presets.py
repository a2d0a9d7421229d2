"""Materials shipped with rsibr, by name."""

from __future__ import annotations

import difflib
from pathlib import Path

from rsibr.errors import InputError
from rsibr.resources import scenes

PRESETS = (
    "candy-red",
    "clearcoat-red",
    "glossy-plastic",
    "matte-lambert",
    "metallic-blue",
    "metallic-silver",
    "mirror-silver",
    "pearl-white",
    "rough-aluminium",
    "solid-red",
)
"""Names of the materials shipped with rsibr, `scenes/materials/NAME.xml`."""


def preset_file(name: str) -> Path:
    """Mitsuba XML of a preset.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    if name not in PRESETS:
        near = difflib.get_close_matches(name, PRESETS, n=1)
        raise InputError(
            f"unknown preset '{name}'{f' (did you mean {near[0]!r}?)' if near else ''}",
            where="material.preset",
            fix=f"use one of: {', '.join(PRESETS)}",
        )
    return scenes() / "materials" / f"{name}.xml"

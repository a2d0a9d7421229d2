"""Bakes of a scene's shapes on the command line: `BAKE` for all shapes, `ID=BAKE` for one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rsibr.errors import InputError


def named_bakes(given: Sequence[str]) -> dict[str, Path]:
    """Bake of each shape id; `"*"` stands for all shapes without one of their own.

    Parameters
    ----------
    given : sequence of str
        `ID=BAKE`, or `BAKE` alone; a path that exists is taken whole, even if it has an equals sign.

    Raises
    ------
    InputError
        If a shape has two bakes, or a part is empty.
    """
    bakes: dict[str, Path] = {}
    for text in given:
        name, equals, path = text.partition("=")
        if not equals or Path(text).exists():
            name, path = "*", text
        if not name or not path:
            raise InputError(f"'{text}' is no bake", where="BAKE", fix="give a directory, or ID=DIRECTORY")
        if name in bakes:
            which = "all other shapes" if name == "*" else f"the shape '{name}'"
            raise InputError(f"two bakes for {which}", where="BAKE", fix="give one; ID=BAKE for a shape of its own")
        bakes[name] = Path(path)
    return bakes


def only_bake(given: Sequence[str]) -> Path:
    """Return the one bake of a command without a scene.

    Raises
    ------
    InputError
        If there are more.
    """
    if len(given) > 1:
        raise InputError(f"{len(given)} bakes and no object", where="BAKE", fix="give one bake, or --object SCENE")
    return Path(given[0])

"""Options that several commands share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from rsibr.errors import InputError

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="Config file (TOML).", show_default=False)]
BakePath = Annotated[Path, typer.Argument(metavar="BAKE", help="Directory of a bake.", show_default=False)]
Imports = Annotated[
    list[str] | None,
    typer.Option(
        "--import",
        metavar="MODULE",
        help="A Python module, or FILE.py, that registers Mitsuba plugins; beside the config's own; repeatable.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")]


def imported(modules: list[str] | None) -> tuple[str, ...]:
    """Import modules that register Mitsuba plugins; return their names for a config, paths made absolute.

    Raises
    ------
    InputError
        If one is not there, raises an error, or registers nothing.
    """
    if not modules:
        return ()
    from pydantic import ValidationError

    from rsibr.scene.config_errors import describe
    from rsibr.scene.plugins_config import PluginsConfig
    from rsibr.scene.python_plugins import load_plugins

    try:
        names = PluginsConfig(modules=tuple(modules)).modules
    except ValidationError as error:
        raise InputError("; ".join(describe(error, PluginsConfig)), where="--import") from None
    load_plugins(names, where="--import")
    return names


def parse_view(text: str) -> tuple[float, float, float]:
    """Read a view direction `X,Y,Z`.

    Raises
    ------
    InputError
        If it is not three numbers.
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        fix = "give three numbers, as in --view 1,0.5,2 (--view=-1,0,0 where the first is negative)"
        raise InputError(f"'{text}' is no direction", where="--view", fix=fix) from None
    return x, y, z


def check_output_folder(folder: Path) -> None:
    """See to it, before hours of work, that `folder` is one that can be written to, or can be made.

    Raises
    ------
    InputError
        If a file stands in its way, or the nearest folder that is there may not be written to.
    """
    nearest = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    fix = "choose another --out"
    if not nearest.is_dir():
        raise InputError(f"{nearest} is a file, not a folder", where="--out", fix=fix)
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{nearest} may not be written to", where="--out", fix=fix)


def check_output_file(file: Path) -> None:
    """See to it that `file` can be written: its folder is there, and it is none itself.

    Raises
    ------
    InputError
        If not.
    """
    if not file.name or file.is_dir():
        raise InputError(f"{file} is a folder", where="--out", fix="name a file in it")
    if not file.parent.is_dir():
        raise InputError(f"there is no folder {file.parent}", where="--out", fix="make it, or choose another place")
    check_output_folder(file.parent)

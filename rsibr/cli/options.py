"""Options that several commands share."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Annotated

import typer

from rsibr import machine
from rsibr.cli.completion import complete_method, complete_override
from rsibr.errors import InputError
from rsibr.picture_size import MOST_PIXELS

_LONGEST_SHOWN = 100
"""Characters of an argument that an error repeats."""

METHODS = "{methods}"
"""Stands in a help text for the names of all listed methods; see `rsibr.cli.commands.Command`."""

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="Config file (TOML).", show_default=False)]
BakePath = Annotated[Path, typer.Argument(metavar="BAKE", help="Directory of a bake.", show_default=False)]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the config; a relative path in it starts at the working folder; repeatable.",
        autocompletion=complete_override,
    ),
]
Method = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help=f"Method: {METHODS}; by default rsibr.",
        autocompletion=complete_method,
    ),
]
MethodsOf = Annotated[
    list[str] | None,
    typer.Option(
        "--method",
        metavar="NAME",
        help=f"Method to compare: {METHODS}; repeatable; by default all.",
        autocompletion=complete_method,
    ),
]
Imports = Annotated[
    list[str] | None,
    typer.Option(
        "--import",
        metavar="MODULE",
        help="Python module, or FILE.py, that registers Mitsuba plugins, in addition to the config's; repeatable.",
    ),
]
Lookup = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="How a surface takes its radiance: pixel, map-grid, map-normal, map-reflection, or auto (the cheapest).",
    ),
]
Yes = Annotated[
    bool, typer.Option("--yes", help="Start even if the job exceeds the free disk space or memory.", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")]


def imported(modules: list[str] | None) -> tuple[str, ...]:
    """Import modules that register Mitsuba plugins; return their names, or absolute paths, for a config.

    Raises
    ------
    InputError
        If a module does not exist, raises an error, or registers nothing.
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


def parse_view(text: str, option: str = "--view") -> tuple[float, float, float]:
    """Parse a view direction, or a position, `X,Y,Z`.

    Raises
    ------
    InputError
        If the text is not three numbers.
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        fix = f"give three numbers, as in {option} 1,0.5,2 ({option}=-1,0,0 where the first is negative)"
        shown = text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}…"
        what = "direction" if option == "--view" else "point"
        raise InputError(f"'{shown}' is no {what}", where=option, fix=fix) from None
    return x, y, z


def parse_resolution(text: str) -> tuple[int, int]:
    """Parse width and height of a picture, `N` or `WxH`.

    Raises
    ------
    InputError
        If the text is neither, or a side is out of range.
    """
    sides = text.lower().replace("×", "x").split("x")
    try:
        width, height = (int(side) for side in (sides * 2 if len(sides) == 1 else sides))
    except ValueError:
        width = height = 0
    if not (1 <= width <= MOST_PIXELS and 1 <= height <= MOST_PIXELS):
        fix = f"give N or WxH, each 1 to {MOST_PIXELS}"
        raise InputError(f"'{text[:_LONGEST_SHOWN]}' is no size of a picture", where="--resolution", fix=fix)
    return width, height


def check_output_folder(folder: Path) -> None:
    """Check, before the work begins, that `folder` is writable or can be created.

    Raises
    ------
    InputError
        If the path or a parent is a file, or if the nearest existing folder is not writable.
    """
    fix = "choose another --out"
    try:
        nearest = machine.existing_folder(folder)
    except OSError as error:
        raise InputError(f"{folder} cannot be used ({error.strerror})", where="--out", fix=fix) from error
    if not nearest.is_dir():
        raise InputError(f"{nearest} is a file, not a folder", where="--out", fix=fix)
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{nearest} is not writable", where="--out", fix=fix)


def check_output_file(file: Path) -> None:
    """Check that `file` can be written; a folder that does not exist is made when it is.

    Raises
    ------
    InputError
        If it is a folder or of a kind that is not written, or if its folder is not writable or cannot be made.
    """
    from rsibr.store.atomic import check_writable

    try:
        if not file.name or file.is_dir():
            raise InputError(f"{file} is a folder", where="--out", fix="name a file in it")
        special = check_writable(file)
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror})", where="--out", fix="name a file") from error
    if special is None or stat.S_ISREG(special):
        check_output_folder(Path(os.path.realpath(file)).parent)

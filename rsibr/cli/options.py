"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.errors import InputError

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="Config file (TOML).", show_default=False)]
BakePath = Annotated[Path, typer.Argument(metavar="BAKE", help="Directory of a bake.", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")]


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

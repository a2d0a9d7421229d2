"""`rsibr pack`: make a bake self-contained."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.options import BakePath, Json
from rsibr.errors import printable


def pack(
    bake: BakePath,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Directory of a copy; by default BAKE itself is packed.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Copy the light that a bake shares with others of its sky into it, so that it can be moved alone."""
    from rsibr.store.pack import pack as run

    packed = run(bake, out=out)
    if json_output:
        typer.echo(json.dumps({"bake": str(packed.path), "views": packed.view_count, "bytes": packed.bytes}))
    else:
        typer.echo(f"{printable(packed.path)}: self-contained, {packed.bytes / 2**20:.1f} MiB")

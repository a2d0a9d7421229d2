"""`rsibr publish`: write files that other programs read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.options import BakePath, Json, Yes, check_output_folder, parse_view
from rsibr.errors import InputError, printable


def _list(asked: bool) -> None:
    """Print the formats with their options and files, and end."""
    if not asked:
        return
    from rsibr.publishing.registry import formats

    for name, one in formats().items():
        options = ", ".join(f"{option}={value}" for option, value in one.options.items())
        typer.echo(f"{name}: {one.summary}; {' '.join(one.files)}{f'; {options}' if options else ''}")
    raise typer.Exit


def publish(
    bake: BakePath,
    formats: Annotated[
        list[str],
        typer.Option("--as", metavar="FORMAT[,OPTION=VALUE]…", help="Formats divided by commas; repeatable."),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the files.")],
    views: Annotated[
        list[str] | None,
        typer.Option("--view", metavar="X,Y,Z|all", help="Direction to the viewer, or all stored views; repeatable."),
    ] = None,
    method: Annotated[
        str | None, typer.Option(help="Method; by default rsibr, and for all stored views their own maps.")
    ] = None,
    resolution: Annotated[int | None, typer.Option(help="Texels a side of the sphere maps; else the bake's.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace files that are there.")] = False,
    list_formats: Annotated[  # noqa: ARG001  # its callback has ended the command
        bool, typer.Option("--formats", is_eager=True, callback=_list, help="List the formats, and end.")
    ] = False,
    allow_large: Yes = False,
    json_output: Json = False,
) -> None:
    """Write maps that other programs read, each of one view, or the light."""
    directions = _views(views)
    check_output_folder(out)
    from rsibr.cli.console import console, step_progress
    from rsibr.publishing.publish import publish as run

    with step_progress("publish") as show:
        made = run(
            bake,
            directions,
            formats,
            out,
            method=method,
            resolution=resolution,
            fresh=fresh,
            allow_large=allow_large,
            on_progress=show,
        )
    for note in made.notes:
        console.print(printable(f"note: {note}"), soft_wrap=True)
    if json_output:
        found = {"files": [str(file) for file in made.files], "views": made.views}
        typer.echo(json.dumps(found | {"notes": list(made.notes), "seconds": made.seconds}))
        return
    for file in made.files:
        typer.echo(printable(file))


def _views(texts: list[str] | None) -> str | tuple[float, ...] | list[tuple[float, ...]] | None:
    """Views as `rsibr.publish` takes them."""
    if not texts:
        return None
    if "all" in texts:
        if len(texts) > 1:
            raise InputError("all views and others", where="--view", fix="give all, or directions")
        return "all"
    directions: list[tuple[float, ...]] = [parse_view(text) for text in texts]
    return directions if len(directions) > 1 else directions[0]

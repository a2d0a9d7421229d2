"""`rsibr view`: the page of a bake, served to a browser or written to a file."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.named_bakes import named_bakes
from rsibr.cli.options import Imports, Json, check_output_file, imported
from rsibr.errors import InputError, printable

if TYPE_CHECKING:
    from rsibr.publishing.page import Page


def view(
    bake: Annotated[
        list[str],
        typer.Argument(
            metavar="[ID=]BAKE...",
            help="Bake to show; with --object bakes of its shapes: BAKE for all, ID=BAKE for one.",
            show_default=False,
        ),
    ],
    object_: Annotated[
        str | None, typer.Option("--object", metavar="SCENE", help="Object: Mitsuba XML, mesh file, or 'sphere'.")
    ] = None,
    export: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write one self-contained file instead of serving.")
    ] = None,
    validation: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Directory of `rsibr validate`: its references, and errors.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(help="Method to offer; repeatable; by default those that read stored maps.")
    ] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port on 127.0.0.1; by default chosen.")] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Open no browser.")] = False,
    allow_large: Annotated[
        bool, typer.Option("--yes", help="Take an object of more than a million triangles.", show_default=False)
    ] = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Look at a bake in the browser: orbit a sphere or an object, compare methods, see errors."""
    named = named_bakes(bake)
    if export is not None:
        _check_export(export, served=port is not None or no_open)
    imported(imports)
    from rsibr.publishing.page import view as make

    page = make(named, mesh=object_, reference=validation, methods=method, allow_large=allow_large)
    _note(page.notes)
    if export is None:
        _serve(page, port or 0, with_browser=not no_open, json_output=json_output)
    else:
        page.write(export)
        _say_file(page, export, json_output=json_output)


def _check_export(file: Path, *, served: bool) -> None:
    if served:
        fix = "leave --port and --no-open out"
        raise InputError("a page that is written is not served", where="--export", fix=fix)
    if file.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{file}: a page is HTML", where="--export", fix="name a file that ends in .html")
    try:
        check_output_file(file)
    except InputError as error:
        raise InputError(error.what, where="--export", fix=error.fix) from error


def _serve(page: Page, port: int, *, with_browser: bool, json_output: bool) -> None:
    """Serve until Ctrl-C, which is how it ends well."""
    from rsibr.publishing.page.server import PageServer

    with PageServer(page.html, port) as server:
        if json_output:
            typer.echo(json.dumps({"url": server.url, "port": server.server_port, "bytes": page.bytes}))
        else:
            typer.echo(f"{printable(page.title)}: {server.url} (Ctrl-C ends it)")
        if with_browser:
            import webbrowser

            webbrowser.open(server.url)
        with suppress(KeyboardInterrupt):
            server.serve_forever(poll_interval=0.1)


def _say_file(page: Page, file: Path, *, json_output: bool) -> None:
    if json_output:
        typer.echo(json.dumps({"file": str(file), "bytes": page.bytes, "notes": list(page.notes)}))
    else:
        typer.echo(f"{printable(file)}: {page.bytes / 2**20:.2f} MiB, works from the disk without a network")


def _note(notes: tuple[str, ...]) -> None:
    from rsibr.cli.console import note

    for one in notes:
        note(one)

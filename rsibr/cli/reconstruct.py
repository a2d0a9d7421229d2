"""`rsibr reconstruct`: reconstruct and write the map of any view."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.options import Json, Yes, check_output_file, parse_view
from rsibr.errors import printable


def reconstruct(
    bake: Annotated[
        Path,
        typer.Argument(
            metavar="BAKE", help="Directory of a bake; or a config, for methods without maps.", show_default=False
        ),
    ],
    view: Annotated[str, typer.Option(metavar="X,Y,Z", help="Direction from the surface to the viewer.")],
    out: Annotated[Path, typer.Option(metavar="FILE.exr|.png", help="File of the map.")],
    method: Annotated[
        str | None, typer.Option(help="Method, by default rsibr; `rsibr validate` measures the error of each.")
    ] = None,
    resolution: Annotated[int | None, typer.Option(help="Texels a side; by default the bake's.")] = None,
    allow_large: Yes = False,
    json_output: Json = False,
) -> None:
    """Reconstruct the sphere map of a view that was not baked, and write it as EXR or PNG."""
    direction = parse_view(view)
    check_output_file(out)
    from rsibr.store.image_kind import image_kind

    image_kind(out)
    from rsibr.cli.console import note_non_finite
    from rsibr.methods.reconstruction import reconstruct as run

    result = run(bake, direction, method=method, resolution=resolution, allow_large=allow_large)
    result.write(out)
    note_non_finite(result)
    if json_output:
        state = {"file": str(out), "view": result.view.tolist(), "method": result.method, "seconds": result.seconds}
        typer.echo(json.dumps(state | {"prepare_seconds": result.prepare_seconds, "resolution": len(result.image)}))
    else:
        typer.echo(
            f"{printable(out)}: {result.method}, {len(result.image)}², prepared in {result.prepare_seconds:.2f} s, "
            f"made in {result.seconds * 1e3:.1f} ms (compiling included)"
        )

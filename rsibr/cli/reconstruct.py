"""`rsibr reconstruct`: reconstruct and write the maps of any views."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rsibr.cli.options import Json, Method, Yes, check_output_file, parse_view
from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.methods.reconstruction import Reconstruction


def reconstruct(
    bake: Annotated[
        Path,
        typer.Argument(
            metavar="BAKE",
            help="Directory of a bake; for methods without maps also a config, or an unfinished bake.",
            show_default=False,
        ),
    ],
    view: Annotated[
        list[str], typer.Option(metavar="X,Y,Z", help="Direction from the surface to the viewer; repeatable.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            metavar="FILE.exr|.png",
            help="File of the map; of several views NAME_0001.exr and so on, or the number in place of #.",
        ),
    ],
    method: Method = None,
    resolution: Annotated[int | None, typer.Option(help="Texels a side; by default the bake's.")] = None,
    allow_large: Yes = False,
    json_output: Json = False,
) -> None:
    """Reconstruct the sphere map of each view that was not baked, and write it as EXR or PNG."""
    directions = [parse_view(text) for text in view]
    check_output_file(out)
    from rsibr.store.image_kind import image_kind

    image_kind(out)
    from rsibr.cli.console import note, note_non_finite
    from rsibr.geometry.frame import unit_view, view_frame
    from rsibr.methods.reconstruction import prepared, run

    frames, files = [view_frame(unit_view(one)) for one in directions], _files(out, len(directions))
    made, side = prepared(bake, method, resolution, allow_large=allow_large)
    told = []
    for frame, file in zip(frames, files, strict=True):
        result = run(made, frame, side)
        result.write(file)
        note_non_finite(result)
        if not result.between_views:
            note(f"{printable(file)}: the view lies outside the stored ones; the nearest of them answer")
        told.append(_record(result, file))
        if not json_output:
            typer.echo(
                f"{printable(file)}: {result.method}, {side}², prepared in {result.prepare_seconds:.2f} s, "
                f"made in {result.seconds * 1e3:.1f} ms{'' if len(told) > 1 else ' (compiling included)'}"
            )
    if json_output:
        typer.echo(json.dumps(told[0] if len(told) == 1 else {"maps": told}))


def _files(out: Path, count: int) -> Sequence[Path]:
    """File of each map: the one that was named, or numbered ones, as for the frames of a sequence."""
    if count == 1:
        return [out]
    from rsibr.shading.pictures.sequence import FrameFiles

    names = FrameFiles.of(out, count)
    return [names.frame(index) for index in range(count)]


def _record(result: Reconstruction, file: Path) -> dict[str, Any]:
    times = {"seconds": result.seconds, "prepare_seconds": result.prepare_seconds}
    state = {"file": str(file), "view": result.view.tolist(), "method": result.method}
    return state | times | {"resolution": len(result.image), "between_views": result.between_views}

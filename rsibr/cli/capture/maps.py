"""`rsibr capture maps`: a bake from photographs of a painted sphere."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from rsibr.cli.capture.options import Curve
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json, check_output_folder


def maps(
    document: Annotated[
        Path, typer.Argument(metavar="CAPTURE.json", help="Photographs, cameras, and the sphere.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(metavar="NAME.rsibr", help="Directory of the bake.", show_default=False)],
    resolution: Annotated[int, typer.Option(help="Texels a side of a map.")] = 128,
    rectify: Annotated[
        Literal["reflection", "normal"], typer.Option(help="For glossy paint, or for matte paint.")
    ] = "reflection",
    curve: Curve = "srgb",
    align: Annotated[bool, typer.Option(help="Shift the shots of a view onto each other.")] = False,
    gap: Annotated[
        float, typer.Option(metavar="DEG", help="Largest circumradius of three views that count as neighbours.")
    ] = 60.0,
    light: Annotated[Path | None, typer.Option(metavar="SKY", help="Environment that lit the sphere.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace a bake of other photographs.")] = False,
    json_output: Json = False,
) -> None:
    """Make a bake of photographs of a painted sphere with poses; it holds no material."""
    check_output_folder(out)
    from rsibr.capture.maps.photographed import capture_maps
    from rsibr.methods.registry import available

    bake = capture_maps(
        document,
        out,
        resolution=resolution,
        rectify=rectify,
        curve=curve,
        align=align,
        gap_deg=gap,
        light=light,
        fresh=fresh,
    )
    record, views = bake.manifest.capture, bake.viewpoints
    assert record is not None
    methods = available(bake)
    facts = {
        "views": bake.view_count,
        "resolution": bake.resolution,
        "covered": views.covered,
        "largest_circumradius_deg": math.degrees(views.largest_circumradius),
        "seen": sum(record.seen) / len(record.seen),
        "variance": record.variance,
        "methods": list(methods),
    }
    seen = f"{facts['seen']:.0%} of their texels were seen"
    line = f"{bake.view_count} maps of {bake.resolution}², {seen}; methods: {', '.join(methods)}"
    report(out, line, facts, record.notes, json_output=json_output)

"""`rsibr capture painted`: an environment from a picture of low dynamic range."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.capture.options import Curve, Height, OutExr, check_output_exr
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json


def painted(
    picture: Annotated[Path, typer.Argument(metavar="PICTURE", help="PNG, JPEG or TIFF.", show_default=False)],
    scale: Annotated[float, typer.Option(help="Radiance of white: nobody measured it.")],
    out: OutExr,
    curve: Curve = "srgb",
    projection: Annotated[str, typer.Option(help="Of the picture, as for environment.projection.")] = "latlong",
    height: Height = None,
    json_output: Json = False,
) -> None:
    """Make an environment of a painted picture, with a stated curve and scale; the file says so."""
    check_output_exr(out, [picture])
    from rsibr.capture.painted import capture_painted

    found = capture_painted(picture, scale=scale, curve=curve, projection=projection, height=height)
    found.write(out)
    rows, columns = found.radiance.shape[:2]
    facts = {"width": columns, "height": rows, "source": found.source}
    report(out, f"{columns} × {rows} texels, {found.source}", facts, found.notes, json_output=json_output)

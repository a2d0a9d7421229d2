"""`rsibr capture six`: an environment from six images, or from six renders of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.capture.options import Curve, Height, OutExr, check_output_exr, three
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json
from rsibr.errors import InputError


def six(
    out: OutExr,
    faces: Annotated[
        str | None, typer.Option(metavar="PATTERN", help="Six images, with {face} for px, nx, py, ny, pz, nz.")
    ] = None,
    scene: Annotated[Path | None, typer.Option(metavar="XML", help="Mitsuba scene to render instead.")] = None,
    at: Annotated[str, typer.Option(metavar="X,Y,Z", help="Place in the scene.")] = "0,0,0",
    size: Annotated[int, typer.Option(help="Pixels along a side of a rendered face.")] = 256,
    samples: Annotated[int, typer.Option(help="Paths a pixel of a render.")] = 256,
    seed: Annotated[int, typer.Option(help="Of the paths.")] = 0,
    height: Height = None,
    curve: Curve = "srgb",
    json_output: Json = False,
) -> None:
    """Make an environment of six images, or of a scene rendered in six directions."""
    check_output_exr(out)
    place = three(at, "--at")
    if faces is not None and "{face}" not in faces:
        raise InputError(f"'{faces}' has no {{face}}", where="--faces", fix="write it as in sky_{face}.png")
    from rsibr.capture.six_images import capture_six
    from rsibr.geometry.projections.faces import FACES

    files = None if faces is None else {face: Path(faces.replace("{face}", face)) for face in FACES}
    found = capture_six(files, scene=scene, at=place, size=size, samples=samples, seed=seed, height=height, curve=curve)
    found.write(out)
    rows, columns = found.radiance.shape[:2]
    facts = {"width": columns, "height": rows, "source": found.source}
    report(out, f"{columns} × {rows} texels, {found.source}", facts, found.notes, json_output=json_output)

"""`rsibr capture synth`: photographs of a ball under a known sky."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.capture.options import three
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json, check_output_folder


def synth(
    environment: Annotated[Path, typer.Argument(metavar="SKY", help="OpenEXR or Radiance map.", show_default=False)],
    view: Annotated[list[str], typer.Option(metavar="X,Y,Z", help="Direction from the ball to a camera; repeatable.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the photographs.", show_default=False)],
    ball: Annotated[
        str, typer.Option(metavar="KIND", help="mirror:METAL, matte:REFLECTANCE, or the name of a preset material.")
    ] = "mirror:Ag",
    distance: Annotated[float, typer.Option(help="Camera to the ball's centre, in radii.")] = 10.0,
    pixels: Annotated[int, typer.Option(help="Pixels along a side.")] = 512,
    shots: Annotated[int, typer.Option(help="Exposures of each view.")] = 8,
    stops: Annotated[float, typer.Option(help="Stops between them.")] = 2.0,
    bits: Annotated[int, typer.Option(help="8 or 16.")] = 8,
    curve: Annotated[str, typer.Option(metavar="NAME|FILE", help="Curve of the camera.")] = "srgb",
    samples: Annotated[int, typer.Option(help="Rays a pixel.")] = 64,
    seed: Annotated[int, typer.Option(help="Of rays and noise.")] = 0,
    json_output: Json = False,
) -> None:
    """Photograph a ball under a sky with a camera of noise, curve and steps: to try a capture out."""
    check_output_folder(out)
    views = [three(one, "--view") for one in view]
    from rsibr.capture.synth import Shooting, capture_synth
    from rsibr.capture.synthetic.scenes import named_ball
    from rsibr.scene.config import EnvironmentConfig
    from rsibr.scene.environment import load_environment

    shooting = Shooting(distance, pixels, shots, stops, bits, curve, samples, seed)
    sky = load_environment(EnvironmentConfig(file=environment))
    path = capture_synth(sky, named_ball(ball), views, out, shooting)
    facts = {"views": len(views), "photographs": len(views) * shots}
    line = f"photographs: {facts['photographs']}, views: {facts['views']}"
    report(path, line, facts, sky.notes, json_output=json_output)

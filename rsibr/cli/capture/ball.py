"""`rsibr capture ball`: an environment from photographs of a mirror ball."""

from __future__ import annotations

from typing import Annotated

import typer

from rsibr.cli.capture.options import (
    Circles,
    Curve,
    Distances,
    Fovs,
    Masks,
    OutExr,
    Shots,
    Up,
    Views,
    ball_shots,
    check_output_exr,
    three,
)
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json


def ball(
    shots: Shots,
    view: Views,
    out: OutExr,
    fov: Fovs = None,
    distance: Distances = None,
    circle: Circles = None,
    mask: Masks = None,
    reflectance: Annotated[
        str, typer.Option(metavar="METAL|NUMBER", help="Of the ball: Ag, Al, Cr, …, by angle, or one number.")
    ] = "Ag",
    height: Annotated[int, typer.Option(help="Rows of the map.")] = 256,
    photographer: Annotated[
        float, typer.Option(metavar="DEG", help="Half angle about the camera's reflection that is left out.")
    ] = 5.0,
    up: Up = "0,1,0",
    curve: Curve = "srgb",
    json_output: Json = False,
) -> None:
    """Make an environment of one or more photographs of a mirror ball; two at 90° show everything."""
    check_output_exr(out, shots)
    balls = ball_shots(shots, view, fov, distance, circle, mask)
    upward = three(up, "--up")
    from rsibr.capture.ball import capture_ball

    found = capture_ball(
        balls, reflectance=reflectance, height=height, up=upward, photographer_deg=photographer, curve=curve
    )
    found.write(out)
    rows, columns = found.seen.shape
    facts = {
        "width": columns,
        "height": rows,
        "seen": float(found.seen.mean()),
        "saturated_texels": int(found.saturated.sum()),
    }
    line = f"{columns} × {rows} texels from {len(balls)} photograph{'s' if len(balls) > 1 else ''}"
    report(out, line, facts, found.notes, json_output=json_output)

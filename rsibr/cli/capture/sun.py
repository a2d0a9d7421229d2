"""`rsibr capture sun`: the energy of a saturated source, from a matte ball."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.capture.options import (
    Circles,
    Curve,
    Distances,
    Fovs,
    Masks,
    OutExr,
    Up,
    Views,
    ball_shots,
    check_output_exr,
    three,
)
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json


def sun(
    environment: Annotated[
        Path, typer.Argument(metavar="SKY.exr", help="Result of `rsibr capture ball`.", show_default=False)
    ],
    shot: Annotated[Path, typer.Argument(metavar="SHOT", help="Photograph of a matte ball.", show_default=False)],
    view: Views,
    out: OutExr,
    fov: Fovs = None,
    distance: Distances = None,
    circle: Circles = None,
    mask: Masks = None,
    reflectance: Annotated[
        float | None, typer.Option(help="Of the matte ball, 0 to 1; by default found in the photograph.")
    ] = None,
    up: Up = "0,1,0",
    curve: Curve = "srgb",
    json_output: Json = False,
) -> None:
    """Find the energy of a source that saturated every shot, from a matte ball in its light, and add it."""
    check_output_exr(out, [environment, shot])
    (ball,) = ball_shots([shot], view, fov, distance, circle, mask)
    upward = three(up, "--up")
    from rsibr.capture.sun import capture_sun

    found = capture_sun(environment, ball, reflectance=reflectance, up=upward, curve=curve)
    found.write(out)
    source = found.sun
    facts = {
        "direction": source.direction.tolist(),
        "irradiance": source.irradiance.tolist(),
        "reflectance": source.reflectance.tolist(),
        "residual": source.residual,
    }
    red, green, blue = source.irradiance
    x, y, z = source.direction
    line = (
        f"the source toward {x:.3f},{y:.3f},{z:.3f} gives {red:.4g}, {green:.4g}, {blue:.4g} W m⁻² (R, G, B); the "
        f"photograph is explained to {source.residual:.1%}"
    )
    report(out, line, facts, (), json_output=json_output)

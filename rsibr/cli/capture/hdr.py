"""`rsibr capture hdr`: merge exposure brackets."""

from __future__ import annotations

from typing import Annotated

import typer

from rsibr.cli.capture.options import OutExr, Shots, check_output_exr, numbers
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json
from rsibr.errors import InputError


def hdr(
    shots: Shots,
    out: OutExr,
    curve: Annotated[
        str,
        typer.Option(metavar="NAME|FILE", help="Curve: srgb, linear, debevec (found in the shots), or a CSV file."),
    ] = "srgb",
    exposures: Annotated[
        str | None, typer.Option(metavar="S,S,…", help="Exposure times in seconds; by default what EXIF says.")
    ] = None,
    noise: Annotated[
        str | None, typer.Option(metavar="FULL,READ", help="Full well and read-out noise of the camera [electrons].")
    ] = None,
    align: Annotated[bool, typer.Option(help="Shift the shots onto each other.")] = True,
    json_output: Json = False,
) -> None:
    """Merge exposure brackets of one view into radiance, variance and saturation."""
    check_output_exr(out, shots)
    times = [_seconds(part) for part in exposures.split(",")] if exposures else []
    electrons = numbers(noise, 2, "--noise") if noise else None
    from rsibr.capture.brackets.noise_model import NoiseModel
    from rsibr.capture.hdr import capture_hdr

    result = capture_hdr(
        shots, curve=curve, exposures=times, noise=NoiseModel(*electrons) if electrons else None, align=align
    )
    result.image.write(out)
    notes = [f"{name}: shows too little to be aligned, and was left out" for name in result.left_out]
    farthest = max((max(abs(x), abs(y)) for x, y in result.shifts.values()), default=0)
    if farthest:
        notes.append(f"shots were shifted onto each other by up to {farthest} pixels; with a tripod use --no-align")
    if result.saturated_box is not None:
        left, right, top, bottom = result.saturated_box
        notes.append(
            f"{result.saturated_pixels} pixels are saturated in every shot (columns {left} to {right}, rows {top} to "
            f"{bottom}): their radiance is a lower bound"
        )
    width, height = result.image.size
    taken = len(shots) - len(result.left_out)
    facts = {
        "width": width,
        "height": height,
        "curve": result.curve.name,
        "shots": taken,
        "shifts": result.shifts,
        "saturated_pixels": result.saturated_pixels,
        "saturated_box": result.saturated_box,
    }
    line = f"{width} × {height} pixels of {taken} shot{'s' * (taken != 1)} by the curve {result.curve.name}"
    report(out, line, facts, notes, json_output=json_output)


def _seconds(text: str) -> float:
    """Seconds, or a fraction such as 1/60."""
    above, _, below = text.partition("/")
    try:
        return float(above) / float(below or 1)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"'{text}' is no time", where="--exposures", fix="give seconds, as in 1/60,0.5,2") from None

"""Options that several subcommands of `rsibr capture` share, and their parsers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from rsibr.cli.options import check_output_file
from rsibr.errors import InputError

if TYPE_CHECKING:
    from rsibr.capture.ball import BallShot

_Value = TypeVar("_Value")

Shots = Annotated[
    list[Path],
    typer.Argument(metavar="SHOT...", help="Photographs: EXR, HDR, PNG, JPEG, TIFF or raw.", show_default=False),
]
Curve = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="Curve of PNG, JPEG and TIFF: srgb, linear, or a CSV file.")
]
OutExr = Annotated[Path, typer.Option("--out", metavar="FILE.exr", help="File of the result.", show_default=False)]
Height = Annotated[int | None, typer.Option(help="Rows of the map; by default what the source calls for.")]
Up = Annotated[str, typer.Option(metavar="X,Y,Z", help="Upward direction of the world; cameras were held level.")]
Views = Annotated[
    list[str], typer.Option("--view", metavar="X,Y,Z", help="Direction from the ball to the camera, one a photograph.")
]
Fovs = Annotated[
    list[float] | None, typer.Option("--fov", metavar="DEG", help="Horizontal field of view, one, or one a photograph.")
]
Distances = Annotated[
    list[float] | None,
    typer.Option("--distance", metavar="RADII", help="Camera to the ball's centre, one, or one a photograph."),
]
Circles = Annotated[
    list[str] | None,
    typer.Option("--circle", metavar="X,Y,R", help="Outline of the ball in pixels, one a photograph."),
]
Masks = Annotated[
    list[Path] | None,
    typer.Option("--mask", metavar="FILE", help="Picture, white on the ball, one a photograph."),
]


def check_output_exr(out: Path, sources: Sequence[Path] = ()) -> None:
    """Check that `out` can be written, is named as OpenEXR, and is none of the photographs it is made of.

    Raises
    ------
    InputError
        If not.
    """
    check_output_file(out)
    if out.suffix.lower() != ".exr" and (out.is_file() or not out.exists()):
        raise InputError(f"{out} is no name of an OpenEXR file", where="--out", fix="end it in .exr")
    if any(_is_same(out, source) for source in sources):
        raise InputError(f"{out} is one of the photographs", where="--out", fix="name another file")


def _is_same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except (OSError, ValueError):  # one of them does not exist, or cannot
        return False


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Parse `count` numbers between commas.

    Raises
    ------
    InputError
        If there are others.
    """
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count:
        shown = text if len(text) < 100 else f"{text[:100]}…"
        raise InputError(f"'{shown}' is not {count} numbers", where=option, fix="separate them by commas, no spaces")
    return found


def three(text: str, option: str) -> tuple[float, float, float]:
    """Parse three numbers between commas."""
    x, y, z = numbers(text, 3, option)
    return x, y, z


def ball_shots(
    files: Sequence[Path],
    views: Sequence[str],
    fovs: Sequence[float] | None,
    distances: Sequence[float] | None,
    circles: Sequence[str] | None,
    masks: Sequence[Path] | None,
) -> list[BallShot]:
    """Photographs of a ball with what the options say of each.

    Raises
    ------
    InputError
        If an option was given neither once for all nor once for each.
    """
    from rsibr.capture.ball import BallShot

    if len(views) != len(files):
        what = f"{len(views)} views for {len(files)} photographs"
        raise InputError(what, where="--view", fix="give one for each, in the same order")
    rows = zip(
        files,
        views,
        _for_each(fovs, len(files), "--fov"),
        _for_each(distances, len(files), "--distance"),
        _for_each(circles, len(files), "--circle", once=False),
        _for_each(masks, len(files), "--mask", once=False),
        strict=True,
    )
    return [
        BallShot(file, three(view, "--view"), fov, distance, three(circle, "--circle") if circle else None, mask)
        for file, view, fov, distance, circle, mask in rows
    ]


def _for_each(
    values: Sequence[_Value] | None, count: int, option: str, *, once: bool = True
) -> Sequence[_Value | None]:
    if not values:
        return [None] * count
    if len(values) == 1 and once:
        return list(values) * count
    if len(values) != count:
        what = f"given {len(values)} times for {count} photographs"
        raise InputError(what, where=option, fix="give it once for each" + (", or once for all" if once else ""))
    return list(values)

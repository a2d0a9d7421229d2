"""`rsibr render`: pictures, turntables and films of an object."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rsibr.cli.named_bakes import named_bakes
from rsibr.cli.options import Imports, Json, Lookup, Method, Yes, check_output_file, imported, parse_resolution
from rsibr.errors import InputError, printable

if TYPE_CHECKING:
    from rsibr.shading.pictures.picture import Picture
    from rsibr.shading.pictures.sequence import RenderedSequence

_LONGEST_SHOWN = 100


class Switch(StrEnum):
    """Settings of an effect."""

    off = "off"
    auto = "auto"
    on = "on"


def render(
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help="Mitsuba XML, mesh file, or 'sphere'.", show_default=False)
    ],
    bake: Annotated[
        list[str], typer.Option(metavar="[ID=]BAKE", help="Bake of the shape ID, or of all other shapes; repeatable.")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="File ending in .exr or .png; of a sequence also .mp4.")],
    method: Method = None,
    lookup: Lookup = "pixel",
    camera: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z[,X,Y,Z]", help="Position of the camera, and its target; else the scene's."),
    ] = None,
    seen_from: Annotated[
        str | None, typer.Option("--from", metavar="X,Y,Z", help="Direction to a camera that sees the whole object.")
    ] = None,
    fov: Annotated[float | None, typer.Option(metavar="DEG", help="Horizontal field of view.")] = None,
    resolution: Annotated[str | None, typer.Option(metavar="N|WxH", help="Pixels, by default the scene's.")] = None,
    rays: Annotated[int, typer.Option(min=1, max=4096, help="Rays a pixel.")] = 16,
    occlusion: Annotated[Switch, typer.Option(help="Whether the object hides the sky from itself.")] = Switch.auto,
    strict: Annotated[bool, typer.Option("--strict", help="Refuse shapes without a bake.")] = False,
    environment_distance: Annotated[
        float | None,
        typer.Option(metavar="UNITS", help="Distance to what surrounds the object: a note says if that is too near."),
    ] = None,
    exposure: Annotated[
        float | None, typer.Option(metavar="STOPS", help="Of a PNG or film; 0: radiance 1 is white. By default chosen.")
    ] = None,
    frames: Annotated[int | None, typer.Option(help="Frames once around the object, or along --path.")] = None,
    path: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Cameras of a path, with --frames.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Make all frames anew.")] = False,
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Render an object from bakes: a picture, a turntable, or a flight along a path."""
    asked = Asked(scene, named_bakes(bake), out, _camera(camera, seen_from, fov), _size(resolution))
    if frames is None and (path is not None or fresh):
        raise InputError("it needs --frames", where="--path" if path else "--fresh", fix="add --frames N")
    _check_out(out, is_sequence=frames is not None)
    imported(imports)
    from rsibr.cli.console import step_progress
    from rsibr.cli.job import note_job

    given: dict[str, Any] = {"method": method, "rays": rays, "lookup": lookup, "occlusion": occlusion.value}
    given |= {
        "environment_distance": environment_distance,
        "strict": strict,
        "exposure": exposure,
        "allow_large": allow_large,
        "on_forecast": note_job,
    }
    with step_progress("render") as show:
        if frames is None:
            picture = asked.picture(on_progress=show, **given)
        else:
            made = asked.sequence(on_progress=show, frames=frames, path=path, fresh=fresh, **given)
    if frames is None:
        _say_picture(picture, out, json_output=json_output)
    else:
        _say_sequence(made, json_output=json_output)


@dataclass(frozen=True)
class Asked:
    """What the command line names, parsed."""

    scene: str
    bakes: dict[str, Path]
    out: Path
    camera: dict[str, Any] | None
    resolution: tuple[int, int] | None

    def picture(self, **given: Any) -> Picture:
        """Render one picture."""
        from rsibr.shading.render import render as run

        return run(self.scene, self.bakes, out=self.out, camera=self.camera, resolution=self.resolution, **given)

    def sequence(self, **given: Any) -> RenderedSequence:
        """Render a sequence."""
        from rsibr.shading.pictures.sequence import render_sequence as run

        return run(self.scene, self.bakes, out=self.out, camera=self.camera, resolution=self.resolution, **given)


def _camera(position: str | None, direction: str | None, fov: float | None) -> dict[str, Any] | None:
    if position is not None and direction is not None:
        raise InputError("both --camera and --from", where="--from", fix="give one of them")
    found: dict[str, Any] = {}
    if position is not None:
        numbers = _numbers(position, "--camera", (3, 6))
        found["position"] = numbers[:3]
        if len(numbers) == 6:
            found["target"] = numbers[3:]
    if direction is not None:
        found["direction"] = _numbers(direction, "--from", (3,))
        if not any(found["direction"]):
            raise InputError("it has no length", where="--from", fix="give a direction such as 1,0.5,2")
    if fov is not None:
        if not 0.01 <= fov <= 179:
            raise InputError(f"a field of view of {fov:g}", where="--fov", fix="give 0.01 to 179 degrees")
        found["fov_deg"] = fov
    return found or None


def _numbers(text: str, option: str, counts: tuple[int, ...]) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(math.isfinite(number) for number in numbers):
        shown = text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}…"
        fix = f"give {' or '.join(map(str, counts))} numbers, as in {option} {'0,1,5,0,0,0'[: 4 * max(counts) - 1]}"
        raise InputError(f"'{shown}' is no place", where=option, fix=fix)
    return numbers


def _size(resolution: str | None) -> tuple[int, int] | None:
    return None if resolution is None else parse_resolution(resolution)


def _check_out(out: Path, *, is_sequence: bool) -> None:
    """Check the name, and that it can be written, before the work."""
    from rsibr.store.image_kind import image_kind

    check_output_file(out)
    if image_kind(out, ("mp4",)) == "mp4" and not is_sequence:
        raise InputError("a film of one picture", where="--out", fix="add --frames N, or name a .png or .exr")
    if is_sequence and out.exists() and not out.is_file():
        raise InputError(
            f"{out} is no file to number", where="--out", fix="name a file that ends in .exr, .png or .mp4"
        )


def _say_picture(picture: Picture, out: Path, *, json_output: bool) -> None:
    _print_notes(picture.notes)
    height, width = picture.alpha.shape
    if json_output:
        found = {"file": str(out), "resolution": [width, height], "covered": float(picture.alpha.mean())}
        times = {"seconds": picture.seconds, "prepare_seconds": picture.prepare_seconds}
        typer.echo(json.dumps(found | times | {"normals": asdict(picture.counts), "notes": list(picture.notes)}))
        return
    typer.echo(
        f"{printable(out)}: {width}×{height}, {picture.alpha.mean():.0%} covered, "
        f"prepared in {picture.prepare_seconds:.2f} s, made in {picture.seconds:.2f} s (compiling included)"
    )


def _say_sequence(made: RenderedSequence, *, json_output: bool) -> None:
    from rsibr.cli.verbosity import is_verbose

    complete = made.kept == made.frames
    if not complete or is_verbose():
        _print_notes(made.notes)
    if json_output:
        found = {"files": [str(file) for file in made.files], "frames": made.frames, "kept": made.kept}
        further = {"already_complete": complete, "seconds": made.seconds, "exposure": made.exposure}
        typer.echo(json.dumps(found | further | {"notes": list(made.notes)}))
        return
    files = " to ".join(printable(file) for file in dict.fromkeys((made.files[0], made.files[-1])))
    if complete:
        typer.echo(f"{files}: already complete, {made.frames} frames")
        return
    kept = f", {made.kept} of them kept from an earlier run" if made.kept else ""
    typer.echo(f"{files}: {made.frames} frames{kept}, in {made.seconds:.1f} s")


def _print_notes(notes: tuple[str, ...]) -> None:
    from rsibr.cli.console import note

    for text in notes:
        note(text)

"""`rsibr validate`: compare a bake with path-traced references."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.named_bakes import named_bakes, only_bake
from rsibr.cli.options import (
    Imports,
    Json,
    Lookup,
    MethodsOf,
    Yes,
    check_output_folder,
    imported,
    parse_resolution,
    parse_view,
)
from rsibr.errors import InputError, printable

if TYPE_CHECKING:
    from rsibr.budget.promise import Promise
    from rsibr.store.bake import Bake
    from rsibr.validation.objects.results import ObjectValidation
    from rsibr.validation.results import Validation

MOST_VIEWS = 10_000
"""Maximum number of views, all of which are held in memory for the report."""


def validate(
    context: typer.Context,
    bake: Annotated[
        list[str],
        typer.Argument(
            metavar="BAKE", help="Directory of a bake; with --object also ID=BAKE for a shape.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Directory for report.html, metrics.json and images.")],
    views: Annotated[int, typer.Option(min=1, max=MOST_VIEWS, help="Novel views: half at centroids, half random.")] = 8,
    view: Annotated[
        list[str] | None, typer.Option(metavar="X,Y,Z", help="View to compare, instead of --views; repeatable.")
    ] = None,
    method: MethodsOf = None,
    samples: Annotated[int, typer.Option(min=8, max=2**24, help="Samples a texel of each reference.")] = 1024,
    lobes: Annotated[
        bool | None,
        typer.Option("--lobes/--no-lobes", help="Errors of single lobes of rsibr; by default if there are several."),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option("--object", metavar="SCENE", help="Judge a picture of this object: XML, mesh file, or 'sphere'."),
    ] = None,
    camera: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Position of the camera, with --object; by default the scene's.")
    ] = None,
    resolution: Annotated[str | None, typer.Option(metavar="N|WxH", help="Pixels of the picture.")] = None,
    rays: Annotated[int, typer.Option(min=1, max=4096, help="Rays a pixel of the picture.")] = 16,
    lookup: Lookup = "pixel",
    occlusion: Annotated[str, typer.Option(metavar="off|auto|on", help="The picture's own shadows.")] = "auto",
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Compare methods with path-traced references at views that were not baked: errors, times, report.

    With --object, compare pictures of an object with open shading and with path tracing, by zone and by cause.

    Exits with 1 if the bake promised an error (`budget.error`) that the default method exceeds at --views novel views.
    """
    given = [parse_view(text) for text in view or ()]
    check_output_folder(out)
    imported(imports)
    _check_options(context, of_object=scene is not None)
    if scene is not None:
        view_of = (camera, resolution, rays, lookup, occlusion)
        _validate_object(scene, bake, out, view_of, method, samples, allow_large=allow_large, json_output=json_output)
        return
    from rsibr.cli.console import step_progress
    from rsibr.cli.job import note_job
    from rsibr.cli.promises import exit_code
    from rsibr.store.bake import open_bake
    from rsibr.validation.validation import validate as run

    opened = open_bake(only_bake(bake))
    with step_progress("validate") as show:
        found = run(
            opened,
            views=given or views,
            methods=method or None,
            samples=samples,
            lobes=lobes,
            out=out,
            on_progress=show,
            on_forecast=note_job,
            allow_large=allow_large,
        )
    print_validation(found, out, json_output=json_output)
    if not given:
        raise typer.Exit(exit_code(_promise(opened, found)))


def _check_options(context: typer.Context, *, of_object: bool) -> None:
    """Refuse options that only the other kind of validation reads."""
    ignored = ("views", "view", "lobes") if of_object else ("camera", "resolution", "rays", "lookup", "occlusion")
    for name in ignored:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            fix = "leave it out: with --object one camera is judged" if of_object else "give --object as well"
            raise InputError("it has no effect here", where=f"--{name}", fix=fix)


def _validate_object(
    scene: str,
    bakes: list[str],
    out: Path,
    view_of: tuple[str | None, str | None, int, str, str],
    methods: list[str] | None,
    samples: int,
    *,
    allow_large: bool,
    json_output: bool,
) -> None:
    camera, resolution, rays, lookup, occlusion = view_of
    position = None if camera is None else parse_view(camera, "--camera")
    size = None if resolution is None else parse_resolution(resolution)
    named = named_bakes(bakes)
    from rsibr import backend
    from rsibr.cli.console import step_progress
    from rsibr.cli.job import note_job
    from rsibr.shading.cameras.camera_choice import chosen_camera
    from rsibr.shading.scenes.scene_file import open_scene
    from rsibr.validation.objects.validation import SIDE, validate_object

    with backend.session(), step_progress("validate") as show:
        opened = open_scene(scene)
        found = validate_object(
            opened,
            named,
            camera=chosen_camera(opened, position and {"position": position}, size, SIDE),
            methods=methods or None,
            lookup=lookup,
            occlusion=occlusion,
            rays=rays,
            samples=samples,
            out=out,
            on_progress=show,
            on_forecast=note_job,
            allow_large=allow_large,
        )
    print_object(found, out, json_output=json_output)


def _promise(bake: Bake, found: Validation) -> Iterator[Promise]:
    """Yield the promised error of the bake, as reached at these views; nothing if it promised none."""
    from rsibr.budget.promise import Promise
    from rsibr.methods.registry import default_method

    budget, judged = bake.manifest.budget, found.summary.get(default_method())
    if budget is not None and budget.promised_error is not None and judged is not None:
        yield Promise("budget.error", budget.promised_error, judged.rel_mse.value, judged.rel_mse.ci95)


def print_validation(found: Validation, out: Path, *, json_output: bool) -> None:
    """Print the table of methods, or the contents of `metrics.json`."""
    if json_output:
        typer.echo((out / "metrics.json").read_text(encoding="utf-8"), nl=False)
        return
    from rsibr.cli.table import new_table, print_table

    errors, times = ("relMSE", "SMAPE", "FLIP"), ("ms a map", "ns a point", "s to bake", "s to prepare")
    table = new_table("method", *errors, *times, "pays after (views)")
    for name, summary in found.summary.items():
        pays = "never" if summary.break_even_views is None else str(summary.break_even_views)
        row = (str(summary.rel_mse), f"{summary.smape:.4f}", f"{summary.flip:.4f}", f"{summary.seconds * 1e3:.1f}")
        point = "" if summary.eval_seconds is None else f"{summary.eval_seconds * 1e9:.0f}"
        prepare = f"{summary.prepare_seconds + summary.compile_seconds:.1f}"
        table.add_row(name, *row, point, f"{summary.bake_seconds:.1f}", prepare, pays)
    print_table(table)
    typer.echo(f"report: {printable(out / 'report.html')}")


def print_object(found: ObjectValidation, out: Path, *, json_output: bool) -> None:
    """Print the table of methods and causes, or the contents of `object.json`."""
    if json_output:
        typer.echo((out / "object.json").read_text(encoding="utf-8"), nl=False)
        return
    from rsibr.cli.table import new_table, print_table

    table = new_table()
    for heading in ("method or cause", "relMSE,\nopen", "relMSE,\npath-traced"):
        table.add_column(heading)  # "below the noise floor" may take two lines on a terminal
    for heading in ("SMAPE", "FLIP", "energy", "ns\na hit", "× path tracing\nof that error"):
        table.add_column(heading, no_wrap=True)
    for name, made in found.methods.items():
        whole = made.open.whole
        energy = "" if whole.energy_ratio is None else f"{whole.energy_ratio.value:.4f}"
        errors = (
            str(whole.rel_mse),
            str(made.full.whole.rel_mse),
            f"{whole.smape.value:.4f}",
            f"{whole.flip.value:.4f}",
        )
        table.add_row(
            name, *errors, energy, f"{made.seconds_of_hit * 1e9:.0f}", f"{made.times_path_tracing:.3g}× the time"
        )
    for cause in found.causes:
        table.add_row(cause.name, str(cause.rel_mse))
    print_table(table)
    typer.echo(f"report: {printable(out / 'report.html')}")

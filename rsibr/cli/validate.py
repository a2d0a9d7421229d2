"""`rsibr validate`: compare a bake with path-traced references."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.options import BakePath, Imports, Json, Yes, check_output_folder, imported, parse_view
from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.budget.promise import Promise
    from rsibr.store.bake import Bake
    from rsibr.validation.results import Validation

MOST_VIEWS = 10_000
"""Maximum number of views, all of which are held in memory for the report."""


def validate(
    bake: BakePath,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Directory for report.html, metrics.json and images.")],
    views: Annotated[int, typer.Option(min=1, max=MOST_VIEWS, help="Novel views: half at centroids, half random.")] = 8,
    view: Annotated[
        list[str] | None, typer.Option(metavar="X,Y,Z", help="View to compare, instead of --views; repeatable.")
    ] = None,
    method: Annotated[list[str] | None, typer.Option(help="Method to compare; repeatable; by default all.")] = None,
    samples: Annotated[int, typer.Option(min=8, max=2**24, help="Samples a texel of each reference.")] = 1024,
    lobes: Annotated[
        bool | None,
        typer.Option("--lobes/--no-lobes", help="Errors of single lobes of rsibr; by default if there are several."),
    ] = None,
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Compare methods with path-traced references at views that were not baked: errors, times, report.

    Exits with 1 if the bake promised an error (`budget.error`) that the default method exceeds at --views novel views.
    """
    given = [parse_view(text) for text in view or ()]
    check_output_folder(out)
    imported(imports)
    from rsibr.cli.console import step_progress
    from rsibr.cli.job import note_job
    from rsibr.cli.promises import exit_code
    from rsibr.store.bake import open_bake
    from rsibr.validation.validation import validate as run

    opened = open_bake(bake)
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
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from rsibr.cli.table import print_table

    table = Table(box=SIMPLE_HEAD)
    for heading in (
        "method",
        "relMSE",
        "SMAPE",
        "FLIP",
        "ms a map",
        "ns a point",
        "s to bake",
        "s to prepare",
        "pays after (views)",
    ):
        table.add_column(heading, no_wrap=True)
    for name, summary in found.summary.items():
        pays = "never" if summary.break_even_views is None else str(summary.break_even_views)
        row = (str(summary.rel_mse), f"{summary.smape:.4f}", f"{summary.flip:.4f}", f"{summary.seconds * 1e3:.1f}")
        point = "" if summary.eval_seconds is None else f"{summary.eval_seconds * 1e9:.0f}"
        prepare = f"{summary.prepare_seconds + summary.compile_seconds:.1f}"
        table.add_row(name, *row, point, f"{found.bake.seconds:.1f}", prepare, pays)
    print_table(table)
    typer.echo(f"report: {printable(out / 'report.html')}")

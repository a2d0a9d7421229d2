"""`rsibr compare`: all systems on the same scenes, at equal time and equal memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.options import Imports, Json, MethodsOf, Yes, check_output_folder, imported
from rsibr.cli.streams import plain
from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.progress import Progress
    from rsibr.studies.compare.budgets import ClassRecord
    from rsibr.studies.compare.runner import Comparison


def compare(
    config: Annotated[
        list[Path],
        typer.Argument(
            metavar="CONFIG", help="Bake configs, one scene each, or files of scenes (TOML).", show_default=False
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Directory for compare.html, .json, .csv, bakes and references.")
    ],
    method: MethodsOf = None,
    external: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=DIR", help="Maps of another program: folder of EXR, or CSV; repeatable."),
    ] = None,
    views: Annotated[
        int | None, typer.Option(min=1, max=1000, help="Novel views, by default 4 or the config's.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(min=8, max=2**24, help="Samples a texel of each reference, by default the config's.")
    ] = None,
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Compare systems on the same scenes: error at equal time and equal memory. A killed comparison resumes."""
    check_output_folder(out)
    from rsibr.cli.console import step_progress
    from rsibr.cli.job import note_job
    from rsibr.studies.compare.config import load_compare
    from rsibr.studies.compare.runner import compare as run

    modules = imported(imports)
    settings = [load_compare(path).with_plugins(modules) for path in config]
    with step_progress("compare") as bars:

        def show(state: Progress) -> None:
            bars(int(state.done), int(state.total))

        found = run(
            settings,
            out=out,
            methods=method or None,
            external=external or (),
            views=views,
            samples=samples,
            on_progress=show,
            on_forecast=note_job,
            allow_large=allow_large,
        )
    if json_output:
        typer.echo((out / "compare.json").read_text(encoding="utf-8"), nl=False)
    else:
        print_comparison(found)


def print_comparison(found: Comparison) -> None:
    """Print the errors by class, and which system has the least from which budget on."""
    from rsibr.studies.compare.page import answers
    from rsibr.validation.report.page import duration

    _print_errors(found.document.classes)
    for record in found.document.classes:
        typer.echo(f"\n{printable(record.name)} ({record.scenes} scene{'s' * (record.scenes != 1)})")
        for sentence in answers(record):
            typer.echo("  " + plain(sentence))
    for scene in found.document.scenes:
        for label, reason in scene.refused.items():
            typer.echo(plain(f"not compared: {label} on {scene.name}: {reason}"))
    typer.echo(f"took {plain(duration(found.document.seconds))}")
    typer.echo(f"report: {printable(found.out / 'compare.html')}")


def _print_errors(classes: Sequence[ClassRecord]) -> None:
    """Print a table of relMSE: a row a setting, a column a class."""
    from rsibr.cli.table import new_table, print_table
    from rsibr.studies.compare.page import shown

    by_class = {record.name: {one.label: shown(one) for one in record.means} for record in classes}
    table = new_table("setting", title="relMSE, geometric mean over the scenes of a class")
    for name in by_class:
        table.add_column(printable(name))
    for label in dict.fromkeys(label for errors in by_class.values() for label in errors):
        errors = (found.get(label) for found in by_class.values())
        table.add_row(printable(label), *(error or "–" for error in errors))
    print_table(table)

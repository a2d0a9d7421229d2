"""The command `rsibr` with its subcommands."""

from __future__ import annotations

import sys
from typing import Annotated, NoReturn

import typer

from rsibr.cli.bake import bake
from rsibr.cli.check import check
from rsibr.cli.demo import demo
from rsibr.cli.doctor import doctor
from rsibr.cli.ending import run
from rsibr.cli.plan import plan
from rsibr.cli.reconstruct import reconstruct
from rsibr.cli.study import study
from rsibr.cli.validate import validate

app = typer.Typer(
    name="rsibr",
    help="Bake a material under a distant environment into radiance maps, reconstruct any view, measure the error.",
    rich_markup_mode=None,  # Rich would delay --help by half a second
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (demo, doctor, plan, bake, check, reconstruct, validate, study):
    app.command()(command)


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.", is_eager=True)] = False,
) -> None:
    """Bake a material under a distant environment, reconstruct any view, measure the error."""
    if version:
        import rsibr

        typer.echo(f"rsibr {rsibr.__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> NoReturn:
    """Run the command line; a failure that the user can fix is printed as one line, with its exit code."""
    sys.exit(run(lambda: app(standalone_mode=False)))

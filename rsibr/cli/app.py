"""The command `rsibr` with its subcommands."""

from __future__ import annotations

import os
import sys
from typing import Annotated, Any, NoReturn

import typer

from rsibr.cli.bake import bake
from rsibr.cli.capture.group import capture
from rsibr.cli.check import check
from rsibr.cli.commands import Command, Commands
from rsibr.cli.compare import compare
from rsibr.cli.completion import by_name_of_the_shell, cut_words_of_bash
from rsibr.cli.demo import demo
from rsibr.cli.doctor import doctor
from rsibr.cli.ending import run
from rsibr.cli.pack import pack
from rsibr.cli.plan import plan
from rsibr.cli.reconstruct import reconstruct
from rsibr.cli.render import render
from rsibr.cli.study import study
from rsibr.cli.validate import validate
from rsibr.cli.verbosity import Verbosity, choose
from rsibr.cli.watchdog import end
from rsibr.errors import RsibrError

by_name_of_the_shell()
app = typer.Typer(
    name="rsibr",
    cls=Commands,
    help="Bake a material under a distant environment into radiance maps, reconstruct any view, measure the error.",
    rich_markup_mode=None,  # Rich would delay --help by half a second
    pretty_exceptions_enable=False,
)
for command in (demo, doctor, plan, bake, pack, check, reconstruct, render, validate, study, compare):
    app.command(cls=Command)(command)
app.add_typer(capture)


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.", is_eager=True)] = False,
) -> None:
    """Bake a material under a distant environment, reconstruct any view, measure the error."""
    if version:
        from rsibr.version import __version__

        typer.echo(f"rsibr {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> NoReturn:
    """Run the command line; a failure that the user can fix is printed as one line, with its exit code."""
    # Read when NumPy and SciPy load, each with a BLAS of its own. Our products are small, and starting the threads of
    # both takes a quarter of a second of processor, more than the mathematics of a view.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cut_words_of_bash()
    end(run(_command))


def _command() -> Any:
    """Run the command; an error that names a Python parameter is raised again with the name of its option."""
    choose(Verbosity.NORMAL)
    try:
        return app(prog_name="rsibr", standalone_mode=False)
    except RsibrError as error:
        option = _options().get(error.where)
        if option is None:
            raise
        raise type(error)(error.what, where=option, fix=error.fix) from error


def _options() -> dict[str, str]:
    """Options of the called command by parameter name."""
    called = typer.main.get_command(app)
    for word in sys.argv[1:]:  # a group's subcommand follows its name
        called = getattr(called, "commands", {}).get(word, called)
    return {one.name: one.opts[0] for one in called.params if one.name and one.opts[0].startswith("-")}

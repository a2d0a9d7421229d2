"""The `rsibr` command: its subcommands, and how a failure ends."""

from __future__ import annotations

import json
import sys
from typing import Annotated, NoReturn

import typer

from rsibr.cli.bake import bake
from rsibr.cli.demo import demo
from rsibr.cli.doctor import doctor
from rsibr.cli.reconstruct import reconstruct
from rsibr.cli.validate import validate
from rsibr.errors import MachineError, RsibrError

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it: 128 + SIGINT."""

app = typer.Typer(
    name="rsibr",
    help="Bake a material under a distant environment into radiance sphere maps, reconstruct any view, know the error.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (demo, doctor, bake, reconstruct, validate):
    app.command()(command)


@app.callback()
def options(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.", is_eager=True)] = False,
) -> None:
    """Bake a material under a distant environment, reconstruct any view, know the error."""
    if version:
        import rsibr

        typer.echo(f"rsibr {rsibr.__version__}")
        raise typer.Exit


def main() -> NoReturn:
    """Run the command line; a failure that the user can act on ends as one line and its exit code."""
    try:
        app()
    except RsibrError as error:
        _say(error)
        sys.exit(error.exit_code)
    except MemoryError:
        _say(MachineError("out of memory", fix="lower map.resolution, or free memory"))
        sys.exit(MachineError.exit_code)
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()  # the reader has gone: nothing more can be said, at exit neither
        sys.exit(0)
    sys.exit(0)


def _say(error: RsibrError) -> None:
    typer.secho(f"error: {error}", fg="red", err=True)
    if "--json" in sys.argv:
        said = {"what": error.what, "where": error.where, "fix": error.fix, "exit_code": error.exit_code}
        typer.echo(json.dumps({"error": said}))

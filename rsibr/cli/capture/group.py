"""The group `rsibr capture` with its subcommands."""

from __future__ import annotations

import typer

from rsibr.cli.capture.ball import ball
from rsibr.cli.capture.hdr import hdr
from rsibr.cli.capture.light import light
from rsibr.cli.capture.maps import maps
from rsibr.cli.capture.painted import painted
from rsibr.cli.capture.six import six
from rsibr.cli.capture.sun import sun
from rsibr.cli.capture.synth import synth
from rsibr.cli.commands import Command, Commands

capture = typer.Typer(
    name="capture",
    cls=Commands,
    help="Make environments and bakes of photographs, renders and paintings.",
    rich_markup_mode=None,
)
for command in (hdr, ball, sun, six, light, painted, maps, synth):
    capture.command(cls=Command)(command)


@capture.callback(invoke_without_command=True)
def helped(context: typer.Context) -> None:
    """Make environments of photographs, renders and paintings."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())

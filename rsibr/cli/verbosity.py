"""How much a command says on stderr: `--quiet`, `--verbose`, before the command or after it."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Annotated, Any

import typer

from rsibr.errors import InputError


class Verbosity(IntEnum):
    """Levels of `--quiet` and `--verbose`."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


_chosen = {Verbosity.NORMAL}


def verbosity() -> Verbosity:
    """Level that the running command was given."""
    return next(iter(_chosen))


def is_quiet() -> bool:
    """Whether only errors and broken promises are to be printed on stderr."""
    return verbosity() is Verbosity.QUIET


def is_verbose() -> bool:
    """Whether notes that were printed before, and the size of every job, are to be printed too."""
    return verbosity() is Verbosity.VERBOSE


def choose(level: Verbosity) -> None:
    """Set the level; a command line sets it to `NORMAL` before it is parsed."""
    _chosen.clear()
    _chosen.add(level)


def verbosity_options() -> list[Any]:
    """Make the options `--quiet` and `--verbose`, for a command or for all commands."""
    holder = typer.Typer(add_completion=False)
    holder.command()(_declares)
    return [one for one in typer.main.get_command(holder).params if one.name in ("quiet", "verbose")]


def _chooses(level: Verbosity) -> Callable[[bool], None]:
    def chosen(given: bool) -> None:
        if not given:
            return
        if verbosity() not in (Verbosity.NORMAL, level):
            where = f"--{level.name.lower()}"
            raise InputError("--quiet and --verbose contradict each other", where=where, fix="give one of them")
        choose(level)

    return chosen


def _declares(
    quiet: Annotated[
        bool,
        typer.Option(
            "--quiet",
            "-q",
            callback=_chooses(Verbosity.QUIET),
            expose_value=False,
            help="Print no progress and no notes: only results and errors.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            callback=_chooses(Verbosity.VERBOSE),
            expose_value=False,
            help="Print notes again that were printed before, the size of every job, and every step.",
        ),
    ] = False,
) -> None:
    """Carry the options."""

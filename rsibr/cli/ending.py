"""How a command ends: its exit code, and the one line (with `--json` the one object) that says what went wrong."""

from __future__ import annotations

import errno
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import typer

from rsibr import clock
from rsibr.errors import InputError, MachineError, RsibrError

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""What Typer raises for a wrong command line; it keeps its own copy of Click and shows only the subclass."""

_GONE = 0
"""Exit code where the reader of stdout has gone, as after `| head`: it has what it wanted."""


class Terminated(BaseException):
    """SIGTERM came: unwinds the stack, so that locks are given free and temporary files removed."""


def run(command: Callable[[], Any]) -> int:
    """Run a command to its end, whatever that is.

    Parameters
    ----------
    command : callable
        Returns an exit code, or None for 0; raises as Typer does when it is not standalone.

    Returns
    -------
    int
        0 done, 1 a check failed, 2 the user's input is wrong, 3 the machine lacks something, 128 + n ended by signal n.
        What is no fault of the user's or the machine's is raised: a bug may show its traceback.
    """
    try:
        with clock.counting(clock.process_start()), _terminable(), _results_alone_on_stdout():
            return _ended(command)
    except BrokenPipeError:
        return _GONE
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EIO):
            raise
        return _fail(MachineError(f"cannot be written ({error.strerror})", where="stdout", fix="free some space"))


def _ended(command: Callable[[], Any]) -> int:
    try:
        code = command()
        _say_time()
        sys.stdout.flush()
    except RsibrError as error:
        return _fail(error)
    except UsageError as error:
        return _fail(_mistyped(error))
    except MemoryError:
        return _fail(MachineError("out of memory", fix="lower map.resolution, or free memory"))
    except Terminated:
        return _interrupted(signal.SIGTERM)
    except (KeyboardInterrupt, typer.Abort):
        code = 128 + signal.SIGINT
    return _interrupted(signal.SIGINT) if code == 128 + signal.SIGINT else int(code or 0)


def _say_time() -> None:
    """Say how long the user waited in all, and for what before the work began; nothing where no backend was used."""
    start_up = clock.start_up_seconds()
    if start_up is None or "--json" in sys.argv:
        return
    whole = time.perf_counter() - clock.waiting_since()
    typer.echo(f"{whole:.1f} s in all, {start_up:.1f} s of it start-up")


def _fail(error: RsibrError) -> int:
    error = _of_the_command_line(error)
    typer.secho(f"error: {error}", fg="red", err=True)
    _say_json(error, error.exit_code)
    return error.exit_code


def _of_the_command_line(error: RsibrError) -> RsibrError:
    """Name the option where an error names the parameter of the Python function that the command calls."""
    from rsibr.cli.app import app

    commands = getattr(typer.main.get_command(app), "commands", {})
    chosen = next((commands[word] for word in sys.argv[1:] if word in commands), None)
    options = {one.name: one.opts[0] for one in chosen.params if one.opts[0].startswith("-")} if chosen else {}
    if error.where not in options:
        return error
    return type(error)(error.what, where=options[error.where], fix=error.fix)


def _interrupted(number: signal.Signals) -> int:
    typer.echo(f"interrupted ({number.name})", err=True)
    _say_json(RsibrError("interrupted", where=number.name), 128 + number)
    return 128 + number


def _say_json(error: RsibrError, exit_code: int) -> None:
    if "--json" in sys.argv:
        said = {"what": error.what, "where": error.where, "fix": error.fix, "exit_code": exit_code}
        typer.echo(json.dumps({"error": said}))


def _mistyped(error: Any) -> InputError:
    """Make Typer's complaint one of ours: it names the option or argument itself."""
    command = error.ctx.command_path if error.ctx else "rsibr"
    return InputError(error.format_message().rstrip(".?"), where=command, fix=f"see `{command} --help`")


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM unwind the stack as Ctrl-C does."""

    def terminate(_number: int, _frame: FrameType | None) -> None:
        raise Terminated

    try:
        before = signal.signal(signal.SIGTERM, terminate)
    except ValueError:  # not in the main thread: signals are another's business
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _results_alone_on_stdout() -> Iterator[None]:
    """Send what libraries print on their own (Mitsuba logs to file descriptor 1) to stderr.

    `sys.stdout` keeps the real stdout, through a copy of its descriptor.
    """
    if sys.stdout is not sys.__stdout__ or sys.stdout is None:
        yield  # someone in this process catches it: leave it be
        return
    before, descriptor = sys.stdout, sys.stdout.fileno()
    before.flush()
    copy = os.dup(descriptor)
    # A file name may hold bytes that are no text, and the terminal may know no `²`.
    sys.stdout = open(copy, "w", encoding=before.encoding, errors="backslashreplace")  # noqa: PTH123, SIM115
    try:
        os.dup2(2, descriptor)
        yield
        sys.stdout.flush()
    except OSError:
        _discard(copy)  # what could not be written would be tried again at exit
        raise
    finally:
        os.dup2(copy, descriptor)
        sys.stdout.close()
        sys.stdout = before


def _discard(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)

"""End of a command: exit code, and the error as one line (with `--json` as one object)."""

from __future__ import annotations

import errno
import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

import typer

from rsibr import clock
from rsibr.cli.streams import alarm, diagnostics, open_standard_streams, results_alone_on_stdout
from rsibr.cli.verbosity import is_quiet
from rsibr.cli.watchdog import ending_after_grace
from rsibr.errors import InputError, MachineError, RsibrError

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""Exception of Typer for an invalid command line: a class of its private copy of Click, with one public subclass."""

_UNWRITABLE = (errno.ENOSPC, errno.EIO)


class Terminated(BaseException):
    """SIGTERM was received; unwinds the stack, so that locks are released and temporary files removed."""


def run(command: Callable[[], Any]) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    command : callable
        Returns an exit code, or None for 0; raises like Typer with `standalone_mode=False`.

    Returns
    -------
    int
        0 success, 1 failed check, 2 invalid input, 3 missing resource of the machine, 128 + n ended by signal n.
        Other exceptions are bugs, and are raised.
    """
    open_standard_streams()
    with (
        clock.counting(clock.command_start()),
        _terminable(),
        diagnostics(),
        results_alone_on_stdout(),
        ending_after_grace(_say_stuck),
    ):
        code = _ended(command)
        try:
            sys.stdout.flush()
        except OSError as error:
            return code or _unheard(error)
        return code


def _ended(command: Callable[[], Any]) -> int:
    try:
        _check_working_folder()
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
    except OSError as error:
        if error.errno not in _UNWRITABLE:
            raise
        return _unheard(error)
    return _interrupted(signal.SIGINT) if code == 128 + signal.SIGINT else int(code or 0)


def _say_time() -> None:
    """Print total time and start-up time on stderr, unless no backend was used."""
    start_up = clock.start_up_seconds()
    if start_up is None or is_quiet() or "--json" in sys.argv:
        return
    whole = time.perf_counter() - clock.waiting_since()
    typer.echo(f"{whole:.1f} s in all, {start_up:.1f} s of it start-up", err=True)


def _fail(error: RsibrError) -> int:
    alarm(f"error: {error}")
    _say_json(error, error.exit_code)
    return error.exit_code


def _interrupted(number: signal.Signals) -> int:
    typer.echo(f"interrupted ({number.name})", err=True)
    _say_json(RsibrError("interrupted", where=number.name), 128 + number)
    return 128 + number


def _say_stuck(number: signal.Signals) -> None:
    """Print what `_interrupted` prints, from another thread: never waits for a full pipe or for a lock of a stream."""
    _write_now(sys.stderr, f"interrupted ({number.name})\n")
    if "--json" in sys.argv:
        _write_now(sys.stdout, _json_of(RsibrError("interrupted", where=number.name), 128 + number) + "\n")


def _write_now(stream: TextIO, text: str) -> None:
    """Write to a stream's descriptor if that is possible without waiting."""
    with suppress(OSError, ValueError):
        if select.select([], [stream], [], 0)[1]:
            os.write(stream.fileno(), text.encode())


def _json_of(error: RsibrError, exit_code: int) -> str:
    said = {"what": error.what, "where": error.where, "fix": error.fix, "exit_code": exit_code}
    return json.dumps({"error": said})


def _say_json(error: RsibrError, exit_code: int) -> None:
    if "--json" in sys.argv:
        with suppress(OSError):  # the exit code tells it too
            typer.echo(_json_of(error, exit_code))


def _unheard(error: OSError) -> int:
    """End of a command whose results stdout did not take."""
    return _fail(MachineError(f"cannot be written ({error.strerror})", where="stdout", fix="free some space"))


def _check_working_folder() -> None:
    try:
        Path.cwd()
    except OSError:
        raise InputError("the working folder no longer exists", fix="change to another one") from None


def _mistyped(error: Any) -> InputError:
    """Convert an exception of Typer; its message names the option or argument."""
    command = error.ctx.command_path if error.ctx else "rsibr"
    told = error.format_message().replace(": Value error, ", ": ").rstrip(".?")
    return InputError(told, where=command, fix=f"see `{command} --help`")


@contextmanager
def _terminable() -> Iterator[None]:
    """Make SIGTERM unwind the stack like Ctrl-C."""

    def terminate(_number: int, _frame: FrameType | None) -> None:
        raise Terminated

    try:
        before = signal.signal(signal.SIGTERM, terminate)
    except ValueError:  # not in the main thread, which alone may set signal handlers
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

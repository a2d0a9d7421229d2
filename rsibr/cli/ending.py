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
from types import FrameType
from typing import Any, TextIO

import typer

from rsibr import clock
from rsibr.cli.watchdog import ending_after_grace
from rsibr.errors import InputError, MachineError, RsibrError

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""Exception of Typer for an invalid command line: a class of its private copy of Click, with one public subclass."""

_GONE = 0
"""Exit code if the reader of stdout has closed it, as after `| head`."""


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
    try:
        with (
            clock.counting(clock.command_start()),
            _terminable(),
            _results_alone_on_stdout(),
            ending_after_grace(_say_stuck),
        ):
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
    """Print total time and start-up time, unless no backend was used."""
    start_up = clock.start_up_seconds()
    if start_up is None or "--json" in sys.argv:
        return
    whole = time.perf_counter() - clock.waiting_since()
    typer.echo(f"{whole:.1f} s in all, {start_up:.1f} s of it start-up")


def _fail(error: RsibrError) -> int:
    typer.secho(f"error: {error}", fg="red", err=True)
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
        typer.echo(_json_of(error, exit_code))


def _mistyped(error: Any) -> InputError:
    """Convert an exception of Typer; its message names the option or argument."""
    command = error.ctx.command_path if error.ctx else "rsibr"
    return InputError(error.format_message().rstrip(".?"), where=command, fix=f"see `{command} --help`")


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


@contextmanager
def _results_alone_on_stdout() -> Iterator[None]:
    """Redirect output of libraries (Mitsuba logs to file descriptor 1) to stderr.

    `sys.stdout` keeps writing to the real stdout, through a copy of its descriptor.
    """
    if sys.stdout is not sys.__stdout__ or sys.stdout is None:
        yield  # stdout is captured already
        return
    before, descriptor = sys.stdout, sys.stdout.fileno()
    before.flush()
    copy = os.dup(descriptor)
    # File names may have undecodable bytes, and the terminal's encoding may lack `²`
    sys.stdout = open(copy, "w", encoding=before.encoding, errors="backslashreplace")  # noqa: PTH123, SIM115
    try:
        os.dup2(2, descriptor)
        yield
        sys.stdout.flush()
    except OSError:
        _discard(copy)  # otherwise the buffer would be written again at exit
        raise
    finally:
        os.dup2(copy, descriptor)
        sys.stdout.close()
        sys.stdout = before


def _discard(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)

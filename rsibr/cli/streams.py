"""Standard streams of a command: open, whoever started it; results alone on stdout; diagnostics that may go unheard."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from rsibr.errors import printable


def open_standard_streams() -> None:
    """Open what the caller closed (`>&-`) on nothing: otherwise the next file would take the number of stdout.

    Libraries that print would then write into that file.
    """
    for descriptor, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != descriptor:
                os.dup2(nowhere, descriptor)
                os.close(nowhere)
        if getattr(sys, f"__{name}__") is None:
            stream = open(descriptor, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)


class _Stream(io.TextIOWrapper):
    """Text stream whose reader may go, as after `| head`: the command then goes on unheard, to its own exit code.

    Other failures, such as a full disk, are raised, unless `forgiving`.
    """

    forgiving = False

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError as error:
            self._bear(error)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            self._bear(error)

    def _bear(self, error: OSError) -> None:
        if not (self.forgiving or isinstance(error, BrokenPipeError)):
            raise error
        _discard(self.fileno())


def _stream(descriptor: int, encoding: str) -> _Stream:
    # File names may have undecodable bytes, and the terminal's encoding may lack `²`
    raw = io.FileIO(descriptor, "w", closefd=False)
    return _Stream(io.BufferedWriter(raw), encoding, "backslashreplace", line_buffering=True)


def plain(text: object) -> str:
    """One line as a terminal and a log take it: ordinary spaces, unprintable characters escaped."""
    return printable(str(text).replace("\u00a0", " "))


def alarm(text: str) -> None:
    """Print a line on stderr; in red on a terminal, unless `NO_COLOR` is set (https://no-color.org)."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    typer.secho(text, fg="red", err=True, color=False if plain else None)


@contextmanager
def diagnostics() -> Iterator[None]:
    """Write stderr through a stream that is never a reason to end."""
    if sys.stderr is not sys.__stderr__ or sys.stderr is None:
        yield  # stderr is captured already
        return
    before = sys.stderr
    before.flush()
    sys.stderr = heard = _stream(before.fileno(), before.encoding)
    heard.forgiving = True
    try:
        yield
    finally:
        heard.flush()
        sys.stderr = before


@contextmanager
def results_alone_on_stdout() -> Iterator[None]:
    """Redirect output of libraries (Mitsuba logs to file descriptor 1) to stderr.

    `sys.stdout` keeps writing to the real stdout, through a copy of its descriptor.
    """
    if sys.stdout is not sys.__stdout__ or sys.stdout is None:
        yield  # stdout is captured already
        return
    before, descriptor = sys.stdout, sys.stdout.fileno()
    before.flush()
    copy = os.dup(descriptor)
    sys.stdout = results = _stream(copy, before.encoding)
    try:
        os.dup2(2, descriptor)
        yield
    finally:
        results.forgiving = True  # what could not be written was an error already, and would be written again at exit
        results.flush()
        os.dup2(copy, descriptor)
        os.close(copy)
        sys.stdout = before


def _discard(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)

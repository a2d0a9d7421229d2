"""Prompt end of a command that was told to stop, even while its main thread is stuck in compiled code.

Python runs a signal handler only when the main thread returns to Python. A long kernel, or a task that never ends,
would keep the command alive after SIGTERM and Ctrl-C. The interpreter writes the number of each signal that it catches
to a *wakeup* descriptor at once; a second thread reads it.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import NoReturn

GRACE = 3.0
"""Time to unwind after a signal [s]: to release locks and to remove temporary files."""

_ENDING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def ending_after_grace(say: Callable[[signal.Signals], None]) -> Iterator[None]:
    """End the process with 128 + n if the block goes on for `GRACE` seconds after signal n (SIGINT or SIGTERM).

    Files that were being written keep their temporary names, which the next bake removes. Outside the main thread,
    which alone receives signals, nothing happens.

    Parameters
    ----------
    say : callable
        Called with the signal before the process ends.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)  # a signal handler may not wait
    try:
        before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    except ValueError:  # not in the main thread
        os.close(reader)
        os.close(writer)
        yield
        return
    left = Event()
    watch = Thread(target=_watch, args=(reader, left, say), name="rsibr-watchdog", daemon=True)
    watch.start()
    try:
        yield
    finally:
        left.set()
        signal.set_wakeup_fd(before)
        os.close(writer)  # ends the watch
        watch.join()
        os.close(reader)


def end(code: int) -> NoReturn:
    """End the process with the exit code of a command; at once after a signal.

    A regular exit waits for kernels in flight, although nobody wants their results any more.
    """
    if code - 128 in _ENDING:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)
    sys.exit(code)


def _watch(reader: int, left: Event, say: Callable[[signal.Signals], None]) -> None:
    while received := os.read(reader, 1):
        number = received[0]
        if number in _ENDING and not left.wait(GRACE):
            say(signal.Signals(number))
            os._exit(128 + number)

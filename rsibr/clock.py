"""Wall time from the user's point of view: since the start of the process (commands) or since the call (Python)."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_IMPORTED = time.perf_counter()
_AT_ONCE = 3.0  # seconds from the first import to the command, if the process was started for it
_SAME_MOMENT = 0.1  # seconds within which two readings of the start of a process agree
_ready: list[float] = []
_waiting_since: ContextVar[float | None] = ContextVar("waiting_since", default=None)


def process_start() -> float:
    """Start of this process on the scale of `time.perf_counter` [s]; that of this import where it is not recorded."""
    try:
        # Field 22 of Linux' stat: clock ticks from boot to process start. Split after ")": the name may contain spaces
        fields = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        age = time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return _IMPORTED
    now = time.perf_counter()
    return min(now - age, _IMPORTED) if 0 <= age < now - _IMPORTED + _LONGEST_START else _IMPORTED


_LONGEST_START = 600.0  # seconds; a longer start-up is attributed to a clock that jumped


def command_start(imported: float = _IMPORTED) -> float:
    """When the user began to wait for a command line: with the process, if it was started for this command.

    Python that has run for a while and calls the command line itself is asked for it only now.

    Parameters
    ----------
    imported : float
        When this module was imported, on the scale of `time.perf_counter`.
    """
    now = time.perf_counter()
    return process_start() if now - imported < _AT_ONCE else now


@contextmanager
def counting(since: float | None = None) -> Iterator[float]:
    """Set the start of the user's wait for the block and everything that it calls.

    Parameters
    ----------
    since : float, optional
        Start; by default that of an enclosing block, otherwise now.

    Yields
    ------
    float
        Start, on the scale of `time.perf_counter` [s].

    Examples
    --------
    >>> with counting() as begun, counting() as inner:
    ...     inner == begun
    True
    """
    begun = waiting_since() if since is None else since
    token = _waiting_since.set(begun)
    try:
        yield begun
    finally:
        _waiting_since.reset(token)


def note_ready() -> None:
    """Record that the backend is ready. The first call ends the start-up time of the process."""
    if not _ready:
        _ready.append(time.perf_counter())


def start_up_seconds() -> float | None:
    """Time from the start of the process to the first ready backend [s].

    None where no backend was used, or the user does not wait since the process started.
    """
    start = process_start()
    waited_for = abs(waiting_since() - start) < _SAME_MOMENT
    return _ready[0] - start if _ready and waited_for else None


def waiting_since() -> float:
    """Start of the user's wait on the scale of `time.perf_counter` [s]: that of the `counting` block, otherwise now."""
    since = _waiting_since.get()
    return time.perf_counter() if since is None else since

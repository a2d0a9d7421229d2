"""How long the user has waited: since the process started inside a command, since the call in Python."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_IMPORTED = time.perf_counter()
_ready: list[float] = []
_waiting_since: ContextVar[float | None] = ContextVar("waiting_since", default=None)


def process_start() -> float:
    """Start of this process on the scale of `time.perf_counter` [s]; where the system does not say, of this import."""
    try:
        # Field 22 of Linux' stat: clock ticks from boot to the start of the process; the name before it may hold spaces
        fields = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        age = time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return _IMPORTED
    now = time.perf_counter()
    return min(now - age, _IMPORTED) if 0 <= age < now - _IMPORTED + _LONGEST_START else _IMPORTED


_LONGEST_START = 600.0  # an age beyond this is no start-up, but a clock that jumped


@contextmanager
def counting(since: float | None = None) -> Iterator[float]:
    """Count what the user waits for from one moment on, also in all that the block calls.

    Parameters
    ----------
    since : float, optional
        The moment; by default now, or that of a block around this one.

    Yields
    ------
    float
        The moment, on the scale of `time.perf_counter`.

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
    """Note that the backend is ready; of the first call what has passed since the process started is the start-up."""
    if not _ready:
        _ready.append(time.perf_counter())


def start_up_seconds() -> float | None:
    """Time from the start of the process until the backend was ready [s]; None where none has been used."""
    return _ready[0] - process_start() if _ready else None


def waiting_since() -> float:
    """When the user began to wait, on the scale of `time.perf_counter`: now, unless inside a `counting` block."""
    since = _waiting_since.get()
    return time.perf_counter() if since is None else since

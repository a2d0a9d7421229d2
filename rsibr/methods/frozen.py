"""Kernel recording (`dr.freeze`): a function is traced at its first call, later calls only launch its kernels."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr

RECORDINGS = 8
"""Recordings kept per function, one for each set of static arguments; the least recently used is dropped."""

_ONE_AT_A_TIME = threading.Lock()


class Frozen:
    """Function of Dr.Jit arrays that is traced once and replayed afterwards (`dr.freeze`).

    Array arguments may change their values between calls. A change of their sizes, or of any other argument, makes a
    new recording.

    Parameters
    ----------
    function : callable
        Must read no array other than its arguments.

    Notes
    -----
    On one core, tracing the kernels of a map takes 0.6 to 0.9 ms, launching their recording 0.04 ms. Dr.Jit aborts the
    process if the memory of a NumPy array is released during a recording. The garbage collector is therefore disabled
    meanwhile, and recorded functions must not create NumPy arrays.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        # For each set of integers one of its own: Dr.Jit 1.5 takes some other arguments to be those of a recording that
        # was made with another integer, and replays an image of another size
        self._frozen: dict[tuple[int, ...], Any] = {}
        self._dropped = 0

    @property
    def recordings(self) -> int:
        """Number of times the function has been traced."""
        return self._dropped + sum(int(one.n_recordings) for one in self._frozen.values())

    def __call__(self, *arguments: Any) -> Any:
        """Replay the recording for these arguments, or make it."""
        with _uncollected():
            return self._of(tuple(one for one in arguments if isinstance(one, int)))(*arguments)

    def _of(self, integers: tuple[int, ...]) -> Any:
        """Recordings with these integers among the arguments; those of the least recently used ones are dropped."""
        known = self._frozen.pop(integers, None)
        self._frozen[integers] = known or dr.freeze(self._function, limit=RECORDINGS, warn_after=2**31 - 1)
        if len(self._frozen) > RECORDINGS:
            self._dropped += int(self._frozen.pop(next(iter(self._frozen))).n_recordings)
        return self._frozen[integers]


@contextmanager
def _uncollected() -> Iterator[None]:
    """Disable the garbage collector. It is shared by the process, hence one thread at a time."""
    with _ONE_AT_A_TIME:
        collects = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if collects:
                gc.enable()

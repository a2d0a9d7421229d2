"""Results of one process that materials under one sky, or skies over one material, have in common: made once.

Keys are digests of content, never paths: a file that changes has another digest. Values are numbers and arrays, no
objects of Mitsuba: every BSDF that lives is compiled into every kernel that dispatches over BSDFs.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

MOST_BYTES = 2**28
"""Memory of all results together [bytes]: some sixteen skies, or thousands of materials."""

SMALL = 2**16
"""Size of a result of a few tables [bytes]."""


class Remembered:
    """Results by key, of limited size; those that were not used for the longest time are forgotten first.

    Parameters
    ----------
    most_bytes : int
        Size of all results.
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self.most_bytes = most_bytes
        self._known: OrderedDict[Any, tuple[Any, float, int]] = OrderedDict()

    def find(self, key: Any) -> tuple[Any, float] | None:
        """Result and the time that it took to make it [s]; None if it is not known."""
        if key not in self._known:
            return None
        self._known.move_to_end(key)
        value, seconds, _ = self._known[key]
        return value, seconds

    def keep(self, key: Any, value: Any, seconds: float, size: int) -> None:
        """Remember a result that took `seconds` to make and has `size` bytes, unless it is larger than all may be."""
        self._known.pop(key, None)
        if size <= self.most_bytes:
            self._known[key] = value, seconds, size
        while self.size > self.most_bytes:
            self._known.popitem(last=False)

    @property
    def size(self) -> int:
        """Size of all results [bytes]."""
        return sum(size for _, _, size in self._known.values())

    def forget(self) -> None:
        """Forget all results."""
        self._known.clear()


in_this_process = Remembered()
"""Shared by all scenes of the process."""


def small(_: Any) -> int:
    """Size of a result of a few tables."""
    return SMALL

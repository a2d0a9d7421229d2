"""Names made unique by a number."""

from __future__ import annotations

from collections.abc import Collection


def unique_name(name: str, taken: Collection[str]) -> str:
    """Return `name`, or with the first number from 2 on that makes it unique.

    Examples
    --------
    >>> unique_name("wheel", {"wheel", "wheel-2"})
    'wheel-3'
    """
    numbers = iter(range(2, len(taken) + 3))
    unique = name
    while unique in taken:
        unique = f"{name}-{next(numbers)}"
    return unique

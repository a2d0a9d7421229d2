"""Checks of the options of methods, which users give on the command line and in configs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError, did_you_mean

Colour = float | Sequence[float] | NDArray[np.float64]
"""One value for all channels, or three."""


def choice(name: str, value: Any, known: Sequence[str]) -> str:
    """Return one of the `known` names."""
    if value not in known:
        fix = did_you_mean(str(value), known) + f"there are: {', '.join(known)}"
        raise InputError(f"unknown {name} '{value}'", where=_where(name), fix=fix)
    return str(value)


def flag(name: str, value: Any) -> bool:
    """Return a truth value."""
    _require(isinstance(value, bool), name, value, "give true or false")
    return bool(value)


def whole(name: str, value: Any, least: int, most: int) -> int:
    """Return a whole number within limits."""
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    _require(is_whole and least <= value <= most, name, value, f"give a whole number from {least} to {most}")
    return int(value)


def power_of_two(name: str, value: Any, most: int) -> int:
    """Return a power of two up to a limit."""
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    is_good = is_whole and 1 <= value <= most and not value & (value - 1)
    _require(is_good, name, value, f"give a power of two up to {most}")
    return int(value)


def number(name: str, value: Any, *, above: float = -np.inf) -> float:
    """Return a finite number above a limit."""
    is_number = type(value) in (int, float) and bool(np.isfinite(value))
    limit = "" if above == -np.inf else f" above {above:g}"
    _require(is_number and float(value) > above, name, value, f"give a number{limit}")
    return float(value)


def colour(name: str, value: Any, *, most: float = np.inf) -> NDArray[np.float64]:
    """Return a colour of shape (3,) in [0, `most`]."""
    try:
        found = np.broadcast_to(np.asarray(value, dtype=np.float64), (3,))
        is_good = bool(np.isfinite(found).all() and (found >= 0).all() and (found <= most).all())
    except (TypeError, ValueError):
        is_good = False
    limit = "≥ 0" if most == np.inf else f"in [0, {most:g}]"
    _require(is_good, name, value, f"give one number or three, {limit}")
    return found


def _require(is_good: bool, name: str, value: Any, fix: str) -> None:
    if not is_good:
        raise InputError(f"{value} is no {name}", where=_where(name), fix=fix)


def _where(name: str) -> str:
    return f"option {name}"

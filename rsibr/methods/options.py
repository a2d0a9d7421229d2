"""Checks of the options of methods, which users give on the command line and in configs."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError, did_you_mean

LARGEST = 1e6
"""Largest value of an option that is a factor; radiance times it stays finite in float32."""

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
    _require(isinstance(value, bool | np.bool_), name, value, "give true or false")
    return bool(value)


def whole(name: str, value: Any, least: int, most: int) -> int:
    """Return a whole number within limits."""
    _require(_is_whole(value) and least <= value <= most, name, value, f"give a whole number from {least} to {most}")
    return int(value)


def power_of_two(name: str, value: Any, most: int) -> int:
    """Return a power of two up to a limit."""
    is_good = _is_whole(value) and 1 <= value <= most and not value & (value - 1)
    _require(is_good, name, value, f"give a power of two up to {most}")
    return int(value)


def number(name: str, value: Any, *, above: float | None = None, most: float = LARGEST) -> float:
    """Return a number above a limit, by default at least −`most`, and up to `most`."""
    is_number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    is_good = is_number and (-most <= value if above is None else above < value) and value <= most
    low = f"from {-most:g}" if above is None else f"above {above:g}"
    _require(is_good, name, value, f"give a number {low} and up to {most:g}")
    return float(value)


def colour(name: str, value: Any, *, most: float = LARGEST) -> NDArray[np.float64]:
    """Return a colour of shape (3,) in [0, `most`]."""
    array = _numbers(value)
    is_good = array is not None and array.shape in {(), (3,)} and bool(((array >= 0) & (array <= most)).all())
    _require(is_good, name, value, f"give one number or three, in [0, {most:g}]")
    return np.array(np.broadcast_to(np.asarray(array), 3))


def table(name: str, value: Any) -> NDArray[np.float64]:
    """Return a table of shape (N, 3), N ≥ 2, of numbers in [0, `LARGEST`]: given as such, or as N numbers."""
    array = _numbers(value)
    if array is not None and array.ndim == 1:
        array = np.repeat(array[:, None], 3, axis=1)
    is_shaped = array is not None and array.ndim == 2 and array.shape[1] == 3 and len(array) >= 2
    is_good = is_shaped and bool(((np.asarray(array) >= 0) & (np.asarray(array) <= LARGEST)).all())
    _require(is_good, name, value, f"give at least two numbers, or rows of three, in [0, {LARGEST:g}]")
    return np.asarray(array)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _numbers(value: Any) -> NDArray[np.float64] | None:
    """Array of numbers, None for anything else."""
    try:
        array = np.asarray(value)
        return array.astype(np.float64) if array.dtype.kind in "iuf" else None
    except (TypeError, ValueError, OverflowError):  # ragged lists, numbers of hundreds of digits
        return None


def _require(is_good: bool, name: str, value: Any, fix: str) -> None:
    if not is_good:
        raise InputError(f"{_shown(value)} is no {name}", where=_where(name), fix=fix)


def _shown(value: Any) -> str:
    if isinstance(value, int) and abs(value) > sys.maxsize:
        return "a number of so many digits"
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:60]}…"


def _where(name: str) -> str:
    return f"option {name}"

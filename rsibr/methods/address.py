"""Method of a user's own, given by the address of its code: `package.module:Class` or `path/to/file.py:Class`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from rsibr.errors import InputError, did_you_mean
from rsibr.scene.fresh_import import imported_afresh


def is_address(name: str) -> bool:
    """Whether a method's name is the address of its code."""
    return ":" in name


def code_at(address: str) -> Callable[..., Any]:
    """Import what makes the method: a class, or a function that takes `MethodInputs` and returns a `Method`.

    Parameters
    ----------
    address : str
        `package.module:Class` or `path/to/file.py:Class`; modules are also found in the working folder. Imported once.

    Raises
    ------
    InputError
        If there is no such module or file, it raises an error, or it has nothing callable of that name.
    """
    return _code_at(address, str(Path.cwd()))


@cache
def _code_at(address: str, folder: str) -> Callable[..., Any]:
    where = f"method {address}"
    module, _, name = address.rpartition(":")
    if not module or not name:
        raise InputError("is no address of a method", where=where, fix="write package.module:Class or file.py:Class")
    with _findable(folder):
        code = imported_afresh(str(Path(module).resolve()) if module.endswith(".py") else module, where)[0]
    found: Callable[..., Any] | None = getattr(code, name, None)
    if not callable(found):
        known = [one for one, value in vars(code).items() if callable(value)]
        what = "is not callable" if hasattr(code, name) else "does not exist"
        raise InputError(f"{module} is there, but {name} in it {what}", where=where, fix=did_you_mean(name, known))
    return found


@contextmanager
def _findable(folder: str) -> Iterator[None]:
    """Find modules in a folder too, as `python -m` does in the working folder."""
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)

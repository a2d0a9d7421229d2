"""Method or format of a user's own, by the address of its code: `package.module:Name` or `path/to/file.py:Name`."""

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
    """Whether a name is the address of code."""
    return ":" in name


def code_at(address: str, kind: str = "method") -> Callable[..., Any]:
    """Import what makes a method, a class or a function that takes `MethodInputs`; or a format.

    Parameters
    ----------
    address : str
        `package.module:Class` or `path/to/file.py:Class`; modules are also found in the working folder. Imported once.
    kind : str
        What it is the address of, for errors.

    Raises
    ------
    InputError
        If there is no such module or file, it raises an error, or it has nothing callable of that name.
    """
    return _code_at(address, kind, str(Path.cwd()))


@cache
def _code_at(address: str, kind: str, folder: str) -> Callable[..., Any]:
    where = f"{kind} {address}"
    module, _, name = address.rpartition(":")
    if not module or not name:
        raise InputError(f"is no address of a {kind}", where=where, fix="write package.module:Class or file.py:Class")
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

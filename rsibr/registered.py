"""What registers itself in a file of its own: its modules found by import, its options read from its factory."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from rsibr.errors import InputError


def import_all(package: str) -> None:
    """Import every module below a package; each registers what it holds."""
    found = importlib.import_module(package)
    for module in pkgutil.walk_packages(found.__path__, f"{package}."):
        importlib.import_module(module.name)


def load_entry_points(group: str) -> None:
    """Load what other packages declare in a group of entry points; each registers what it holds."""
    for entry in entry_points(group=group):
        load_entry_point(entry)


def load_entry_point(entry: EntryPoint) -> None:
    """Load one entry point.

    Raises
    ------
    InputError
        If it cannot be loaded; names the package that is at fault.
    """
    try:
        entry.load()
    except Exception as error:
        raise InputError(
            f"cannot be loaded: {type(error).__name__}: {error}",
            where=f"entry point '{entry.name}' of {entry.group} ({entry.value})",
            fix="fix or uninstall that package",
        ) from error


def keyword_options(make: Callable[..., Any]) -> dict[str, Any]:
    """Keyword-only parameters of a factory with their defaults: the options of what it makes.

    Examples
    --------
    >>> def make(inputs, *, weights="area"): ...
    >>> keyword_options(make)
    {'weights': 'area'}
    """
    parameters = inspect.signature(make).parameters.values()
    return {one.name: one.default for one in parameters if one.kind is one.KEYWORD_ONLY}

"""What registers itself in a file of its own: its modules found by import, its options read from its factory."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable
from typing import Any


def import_all(package: str) -> None:
    """Import every module below a package; each registers what it holds."""
    found = importlib.import_module(package)
    for module in pkgutil.walk_packages(found.__path__, f"{package}."):
        importlib.import_module(module.name)


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

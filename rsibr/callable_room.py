"""Rooms that can be called like the one function that they are there for."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any


def make_callable(room: str, home: str, function: str) -> None:
    """Let a package be called: `rsibr.bake(…)` is the function, and `rsibr.store.bake` a module in the package.

    Both names mean the same object, whichever was imported first: Python binds a package to its parent when it is
    imported, over anything else of that name.

    Parameters
    ----------
    room : str
        Name of the package, already imported.
    home : str
        Module that holds the function; imported at the first call.
    function : str
        The function's name.
    """

    class Room(ModuleType):
        def __call__(self, *args: Any, **kwargs: Any) -> Any:
            return getattr(importlib.import_module(home), function)(*args, **kwargs)

    sys.modules[room].__class__ = Room

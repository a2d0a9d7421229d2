"""Methods of a class whose code lies in a room above its own, imported when they are first called.

Imports run downward only: a bake on disk knows nothing of pages and plots. What a notebook shows of it is a function of
a higher room all the same; the class names it by its address, as the package `rsibr` names its public functions.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any


def late(address: str, doc: str) -> Callable[..., Any]:
    """Method that calls the function at `address` with the object as its first argument.

    Parameters
    ----------
    address : str
        "package.module:function".
    doc : str
        Docstring of the method.

    Examples
    --------
    >>> class Name(str):
    ...     shown = late("pprint:pformat", "Representation of the name.")
    >>> Name("rsibr").shown()
    "'rsibr'"
    """
    module, _, name = address.partition(":")

    def method(self: Any, *arguments: Any, **options: Any) -> Any:
        return getattr(importlib.import_module(module), name)(self, *arguments, **options)

    method.__name__, method.__qualname__, method.__doc__ = name, name, doc
    return method

"""Whether calls from Python show their progress and their notes, as commands do: by default in IPython and notebooks.

Functions of all rooms are decorated; bars are drawn in a room above theirs, which is imported when something is shown.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from threading import Lock
from typing import Any, Literal, ParamSpec, TypeVar, cast

from rsibr.errors import InputError
from rsibr.progress import Job, Progress, as_progress

Shown = bool | Literal["auto"]

_DISPLAY = "rsibr.publishing.progress.display"

_P = ParamSpec("_P")
_R = TypeVar("_R")

_chosen: list[Shown] = ["auto"]

_inside: ContextVar[bool] = ContextVar("inside", default=False)
"""Whether this thread is in a call that shows progress, or reports it to the user: calls within it show nothing."""

_display = Lock()
"""Held by the thread that shows something: calls of other threads show nothing meanwhile."""


def show_progress(shown: Shown = "auto") -> None:
    """Choose whether rsibr shows progress and notes of its calls, for the rest of this process.

    Parameters
    ----------
    shown : bool or "auto"
        True: as bars in a notebook or a terminal, elsewhere as lines on stderr. False: never. "auto", which it is at
        first: in IPython and notebooks only, so that a script prints nothing of its own accord.

    Raises
    ------
    InputError
        If it is none of these.

    Notes
    -----
    A call that is given `on_progress` shows nothing: it calls that.

    Examples
    --------
    >>> import rsibr
    >>> rsibr.show_progress(False)
    >>> rsibr.show_progress()
    """
    if not (isinstance(shown, bool) or shown == "auto"):
        raise InputError(
            f"{shown!r} is neither a truth value nor 'auto'", where="show_progress", fix="give True or False"
        )
    _chosen[0] = shown


def shell() -> Any:
    """The IPython that this code runs in; None in a plain Python."""
    module = sys.modules.get("IPython")
    return None if module is None else module.get_ipython()


def shows_progress(job: Job) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Decorate a function with a keyword `on_progress` so that it shows its progress, and its result's `notes`.

    Notes are shown if there was progress, and not again for a result that was there already.

    Parameters
    ----------
    job : Job
        What is counted.
    """

    def decorated(function: Callable[_P, _R]) -> Callable[_P, _R]:
        @wraps(function)
        def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            if _inside.get():
                return function(*args, **kwargs)
            with _alone():
                if kwargs.get("on_progress") is None and _is_wanted() and _display.acquire(blocking=False):
                    try:
                        return _shown(job, cast("Callable[..., _R]", function), args, kwargs)
                    finally:
                        _display.release()
                return function(*args, **kwargs)

        return call

    return decorated


def _shown(job: Job, function: Callable[..., _R], args: tuple[Any, ...], kwargs: dict[str, Any]) -> _R:
    worked = False

    def on_progress(*state: Progress | float) -> None:
        nonlocal worked
        worked = True
        display.show(as_progress(*state))

    with importlib.import_module(_DISPLAY).displayed(job) as display:
        result = function(*args, **{**kwargs, "on_progress": on_progress})
    if worked and (notes := getattr(result, "notes", ())):
        display.say(notes)
    return result


def _is_wanted() -> bool:
    (chosen,) = _chosen
    return shell() is not None if chosen == "auto" else chosen


@contextmanager
def _alone() -> Iterator[None]:
    token = _inside.set(True)
    try:
        yield
    finally:
        _inside.reset(token)

"""Registry of executors by name. An executor registers itself in its own file; no other file refers to it by name.

Modules below `rsibr/batches/executors/` are found by import, executors of installed packages by entry points of the
group `rsibr.executors`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Protocol, TypeVar

from rsibr.batches.config import RunConfig
from rsibr.batches.ledger import Ledger
from rsibr.errors import InputError, did_you_mean
from rsibr.registered import import_all, load_entry_points

ENTRY_POINTS = "rsibr.executors"
"""Entry-point group in which other packages declare executors."""


class Executor(Protocol):
    """What runs the tasks of a ledger.

    Attributes
    ----------
    crowded : bool
        Whether all its workers share this machine; see `rsibr.batches.ledger.Ledger`.
    """

    crowded: bool

    def workers(self, run: RunConfig) -> int:
        """Number of workers that it will have at first; no more is read ahead of the jobs."""
        ...

    def run(self, ledger: Ledger, run: RunConfig) -> None:
        """Give tasks to workers until the ledger is over.

        A task is taken by `ledger.next`, and ends with `ledger.ended` or `ledger.died`. Whatever ends this function
        ends its workers.

        Raises
        ------
        MachineError
            If no worker can be had, or all are lost.
        """
        ...


Made = TypeVar("Made", bound=Callable[[], Executor])

_REGISTERED: dict[str, Callable[[], Executor]] = {}


def register(name: str) -> Callable[[Made], Made]:
    """Register an executor by name; decorates its class.

    Examples
    --------
    >>> @register("nowhere")                                                                # doctest: +SKIP
    ... class Nowhere:
    ...     crowded = True
    """

    def decorate(made: Made) -> Made:
        _REGISTERED[name] = made
        return made

    return decorate


def executor_names() -> list[str]:
    """Names of all executors, sorted."""
    _discover()
    return sorted(_REGISTERED)


def executor_of(name: str) -> Executor:
    """Make the executor of a name.

    Raises
    ------
    InputError
        If there is none; the message suggests the nearest one and lists all.
    """
    known = executor_names()
    if name not in known:
        fix = did_you_mean(name, known) + f"there are: {', '.join(known)}"
        raise InputError(f"unknown executor '{name}'", where="run.executor", fix=fix)
    return _REGISTERED[name]()


@cache
def _discover() -> None:
    import_all("rsibr.batches.executors")
    load_entry_points(ENTRY_POINTS)

"""Registry of the effects of an object. An effect registers itself in its own file; no other file lists them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

from rsibr.errors import InputError, did_you_mean
from rsibr.planning.plan import Effect
from rsibr.registered import import_all
from rsibr.shading.effects.evidence import Evidence

Decide = Callable[[Evidence], Effect]
"""Evidence, with the switches → decision."""

SWITCHES = ("auto", "on", "off")
"""What an effect can be set to."""

_F = TypeVar("_F", bound=Decide)
_REGISTERED: dict[str, EffectRegistration] = {}


@dataclass(frozen=True)
class EffectRegistration:
    """Entry of the registry.

    Attributes
    ----------
    name : str
        Name, by which it is forced on or off.
    rank : int
        Position in the plan, ascending.
    decide : callable
        Its decision.
    switchable : bool
        Whether it can be forced; effects that are only flagged cannot.
    """

    name: str
    rank: int
    decide: Decide
    switchable: bool


def register_effect(name: str, *, rank: int, switchable: bool = True) -> Callable[[_F], _F]:
    """Register the function that decides on an effect."""

    def decorate(decide: _F) -> _F:
        _REGISTERED[name] = EffectRegistration(name, rank, decide, switchable)
        return decide

    return decorate


def object_effects() -> dict[str, EffectRegistration]:
    """All effects by name, in the order of a plan."""
    _discover()
    return dict(sorted(_REGISTERED.items(), key=lambda item: item[1].rank))


def check_switches(switches: Mapping[str, str]) -> None:
    """Check what is to be forced.

    Raises
    ------
    InputError
        If there is no effect of a name, or a value is not one of `SWITCHES`, or an effect cannot be forced.
    """
    known = object_effects()
    for name, value in switches.items():
        if name not in known:
            there = f"there are: {', '.join(known)}"
            raise InputError(f"unknown effect '{name}'", where="effects", fix=did_you_mean(name, known) + there)
        if value not in SWITCHES:
            raise InputError(f"'{value}'", where=f"effects.{name}", fix=f"give one of: {', '.join(SWITCHES)}")
        if value != "auto" and not known[name].switchable:
            raise InputError("it is only measured, never switched", where=f"effects.{name}", fix="leave it at auto")


@cache
def _discover() -> None:
    """Import every module of this package, once; each registers its effect."""
    import_all("rsibr.shading.effects")

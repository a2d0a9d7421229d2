"""Plan of a picture: the effects of being an object that it simulates, and what it leaves out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rsibr.planning.plan import Effect, number, unique
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import check_switches, object_effects


@dataclass(frozen=True, repr=False)
class ObjectPlan:
    """Decisions on what a picture simulates beyond the maps; read like `rsibr.planning.plan.Plan`.

    Attributes
    ----------
    effects : tuple of Effect
        All effects that were considered.
    """

    effects: tuple[Effect, ...]

    @classmethod
    def of(cls, evidence: Evidence) -> ObjectPlan:
        """Decide on every effect.

        Raises
        ------
        InputError
            If a switch names no effect, or has no known value.
        """
        check_switches(evidence.switches)
        return cls(unique(one.decide(evidence) for one in object_effects().values()))

    def __repr__(self) -> str:
        on = ", ".join(effect.name for effect in self.effects if effect.on)
        return f"ObjectPlan(on: {on or 'nothing'})"

    def __str__(self) -> str:
        """One line an effect."""
        return "\n".join(self.lines())

    def __getitem__(self, name: str) -> Effect:
        """Return the effect of that name; KeyError if there is none."""
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise KeyError(name)

    @property
    def missed(self) -> tuple[Effect, ...]:
        """Effects that matter here and are left out."""
        return tuple(effect for effect in self.effects if effect.missed)

    def lines(self) -> Iterator[str]:
        """One line an effect: state, evidence, threshold, reason, and the error of leaving it out."""
        for effect in self.effects:
            state = ("on" if effect.on else "off") + (" (as set)" if effect.forced else "")
            error = "?" if effect.error_if_left_out is None else number(effect.error_if_left_out)
            yield (
                f"{effect.name}: {state}: {effect.why} [{number(effect.evidence)} {effect.unit}, threshold "
                f"{number(effect.threshold)}; relMSE without it {error}]"
            )

    def notes(self) -> Iterator[str]:
        """One sentence for each effect that matters and is left out, with its estimated error."""
        for effect in self.missed:
            error = effect.error_if_left_out
            cost = "" if error is None else f"; estimated error (relMSE) {number(error)}"
            yield f"{effect.name}: {effect.left_out} ({number(effect.evidence)} {effect.unit}{cost})"

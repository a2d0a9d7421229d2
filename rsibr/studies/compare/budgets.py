"""Which system has the least error for a budget of time or memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from rsibr.studies.compare.records import ComparedScene, CostRecord, SystemRecord
from rsibr.studies.fronts import front_of
from rsibr.studies.results import Positive, Record

COSTS: dict[str, Callable[[CostRecord], float]] = {
    "once_seconds": lambda cost: cost.once_seconds,
    "bytes": lambda cost: max(float(cost.bytes), _LEAST_BYTES),
    "frame_seconds": lambda cost: cost.frame_seconds.median,
}
"""Costs, each with a front and a table: time before the first map, bytes on the device, time of a map."""

_LEAST_BYTES = 64.0
"""Memory that a method without arrays counts as, so that it has a place on a logarithmic axis."""

_STEPS = {"s": (1.0, 2.0, 5.0), "B": (1.0, 4.0, 16.0, 64.0, 256.0)}
_MOST_ROWS = 9

_EQUAL_COST = 1.05
"""Ratio of two costs below which they count as equal."""

_LEAST = float(np.finfo(np.float32).tiny)

_Z = 1.96
"""Standard errors of half a 95 % interval."""


@dataclass(frozen=True)
class Candidate:
    """A setting of a system with its error and costs, on one scene or as geometric means over several.

    Attributes
    ----------
    label, system : str
    rel_mse : float
        Positive.
    spread : float
        Standard error of its logarithm.
    costs : dict of str to float
        By the names of `COSTS`.
    is_bound : bool
        Whether `rel_mse` is an upper limit: the error, on one scene or on some of them, is below the noise floor.
    """

    label: str
    system: str
    rel_mse: float
    spread: float
    costs: dict[str, float]
    is_bound: bool = False

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % confidence interval of the error, due to the noise of the references."""
        reach = math.exp(min(_Z * self.spread, 300.0))
        return self.rel_mse / reach, self.rel_mse * reach

    def is_level_with(self, other: Candidate) -> bool:
        """Whether the intervals of the two errors overlap, so that neither is known to be less."""
        (low, high), (its_low, its_high) = self.ci95, other.ci95
        return low <= its_high and its_low <= high


class MeanRecord(Record):
    """A setting of a system over the scenes of a class: geometric means."""

    label: str
    system: str
    rel_mse: Positive = Field(description="an error below the noise floor counts as its upper limit")
    is_bound: bool = Field(False, description="an upper limit: below the noise floor on a scene or on several")
    ci95: tuple[Positive, Positive] = Field(description="due to the noise of the references")
    costs: dict[str, Positive] = Field(description="once_seconds, bytes, frame_seconds; empty for external maps")


class WinnerRecord(Record):
    """From this budget on, up to that of the next winner, this setting has the least error."""

    budget: Positive = Field(description="its own cost")
    label: str
    system: str
    rel_mse: Positive
    is_bound: bool = Field(False, description="an upper limit: below the noise floor on a scene or on several")
    level_with: list[str] = Field(description="other systems below the next budget whose error intervals overlap")


class BestRecord(Record):
    """Least error of one system within a budget."""

    label: str
    rel_mse: Positive
    is_bound: bool = Field(False, description="an upper limit: below the noise floor on a scene or on several")
    is_least: bool = Field(description="of all systems within the budget, or level with the least")


class BudgetRecord(Record):
    """Least error of each system within one budget."""

    budget: Positive
    best: dict[str, BestRecord] = Field(description="by system; without those that exceed the budget")


class ClassRecord(Record):
    """All systems on the scenes of one class of materials."""

    material_class: str | None = Field(description="null: all scenes")
    scenes: int
    means: list[MeanRecord] = Field(description="settings that were measured on all of its scenes")
    winners: dict[str, list[WinnerRecord]] = Field(description="by cost, in ascending order of the budget")
    tables: dict[str, list[BudgetRecord]] = Field(description="by cost: equal time or equal memory a row")

    @property
    def name(self) -> str:
        """Name to show."""
        return "all" if self.material_class is None else self.material_class


def classes_of(scenes: Sequence[ComparedScene]) -> list[ClassRecord]:
    """Compare the systems class by class.

    Parameters
    ----------
    scenes : sequence of ComparedScene

    Returns
    -------
    list of ClassRecord
        All scenes together first if there is more than one class, then each class.
    """
    by_class: dict[str | None, list[ComparedScene]] = {}
    for scene in scenes:
        by_class.setdefault(scene.material_class, []).append(scene)
    everything: dict[str | None, list[ComparedScene]] = {None: list(scenes)} if len(by_class) > 1 else {}
    return [_class(name, found) for name, found in (everything | by_class).items()]


def winners(candidates: Sequence[Candidate], cost: str) -> list[WinnerRecord]:
    """Settings with the least error, each from its own cost on: the Pareto front over all systems, where it is known.

    A dearer setting takes over only where its error is known to be less, i.e. the intervals do not overlap. One that
    costs hardly more takes over in any case, because times are not known better.

    Parameters
    ----------
    candidates : sequence of Candidate
        Those that have the cost.
    cost : str
        Name of a cost.
    """
    front = front_of([one.costs[cost] for one in candidates], [one.rel_mse for one in candidates])
    taken: list[Candidate] = []
    for group in _of_equal_cost([candidates[index] for index in front.on], cost):
        best = group[-1]  # on a front the dearest errs least
        if not taken or not best.is_level_with(taken[-1]):
            taken.append(best)
    ends = [*(one.costs[cost] for one in taken[1:]), math.inf][: len(taken)]
    return [_winner(one, candidates, cost, end) for one, end in zip(taken, ends, strict=True)]


def budget_table(candidates: Sequence[Candidate], cost: str, unit: str) -> list[BudgetRecord]:
    """Least error of each system within round budgets, from the cheapest setting to the dearest.

    Parameters
    ----------
    candidates : sequence of Candidate
        Those that have the cost.
    cost : str
        Name of a cost.
    unit : {"s", "B"}
        Its unit.
    """
    values = [one.costs[cost] for one in candidates]
    return [_within(candidates, cost, budget) for budget in ladder(min(values), max(values), unit)] if values else []


def ladder(low: float, high: float, unit: str) -> list[float]:
    """Round numbers from the first that is not below `low` to the first that is not below `high`, nine at most.

    Seconds in steps of 1, 2, 5; bytes in powers of four. Where these would be too many, every second, third … is left.

    Examples
    --------
    >>> ladder(0.3, 4.0, "s")
    [0.5, 1.0, 2.0, 5.0]
    >>> ladder(3000, 70000, "B")
    [4096.0, 16384.0, 65536.0, 262144.0]
    """
    base = 10.0 if unit == "s" else 1024.0
    low = max(low, _LEAST)
    first, last = (math.floor(math.log(value, base)) for value in (low, max(high, low)))
    steps = [step * base**exponent for exponent in range(first - 1, last + 2) for step in _STEPS[unit]]
    start = next(index for index, step in enumerate(steps) if step >= low * (1 - 1e-9))
    end = next(index for index, step in enumerate(steps) if step >= high * (1 - 1e-9))
    stride = -(-(end - start + 1) // _MOST_ROWS)
    return steps[end : (start - 1 if start else None) : -stride][::-1]


def unit_of(cost: str) -> str:
    """Unit of a cost, "s" or "B"."""
    return "B" if cost == "bytes" else "s"


def _class(name: str | None, scenes: Sequence[ComparedScene]) -> ClassRecord:
    means = mean_candidates(scenes)
    measured = [one for one in means if one.costs]
    return ClassRecord(
        material_class=name,
        scenes=len(scenes),
        means=[
            MeanRecord(
                label=one.label,
                system=one.system,
                rel_mse=one.rel_mse,
                is_bound=one.is_bound,
                ci95=one.ci95,
                costs=one.costs,
            )
            for one in means
        ],
        winners={cost: winners(measured, cost) for cost in COSTS},
        tables={cost: budget_table(measured, cost, unit_of(cost)) for cost in COSTS},
    )


def mean_candidates(scenes: Sequence[ComparedScene]) -> list[Candidate]:
    """Geometric means of error and costs of each setting that was measured on all scenes."""
    by_label: dict[str, list[Candidate]] = {}
    for scene in scenes:
        for record in scene.systems:
            by_label.setdefault(record.label, []).append(candidate(record))
    return [_mean(found) for found in by_label.values() if len(found) == len(scenes)]


def candidate(record: SystemRecord) -> Candidate:
    """Error and costs of a setting on one scene."""
    error = record.error.rel_mse
    is_bound = error.below_noise_floor
    value = max(error.ci95[1] if is_bound else error.value, error.resolved, _LEAST)
    costs = {} if record.cost is None else {name: cost(record.cost) for name, cost in COSTS.items()}
    return Candidate(record.label, record.system, value, error.half_interval / (_Z * value), costs, is_bound)


def _mean(found: Sequence[Candidate]) -> Candidate:
    costs = {name: _geometric([one.costs[name] for one in found]) for name in found[0].costs}
    spread = math.hypot(*(one.spread for one in found)) / len(found)
    rel_mse, is_bound = _geometric([one.rel_mse for one in found]), any(one.is_bound for one in found)
    return replace(found[0], rel_mse=rel_mse, spread=spread, costs=costs, is_bound=is_bound)


def _geometric(values: Sequence[float]) -> float:
    return float(np.exp(np.mean(np.log(np.maximum(values, _LEAST)))))


def _of_equal_cost(front: Sequence[Candidate], cost: str) -> list[list[Candidate]]:
    """Group the settings of a front, in ascending order of cost, whose costs exceed that of the first hardly."""
    groups: list[list[Candidate]] = []
    for one in front:
        if groups and one.costs[cost] <= _EQUAL_COST * groups[-1][0].costs[cost]:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _winner(best: Candidate, candidates: Sequence[Candidate], cost: str, end: float) -> WinnerRecord:
    level = [
        one.system
        for one in candidates
        if one.system != best.system and one.costs[cost] < end and best.is_level_with(one)
    ]
    return WinnerRecord(
        budget=best.costs[cost],
        label=best.label,
        system=best.system,
        rel_mse=best.rel_mse,
        is_bound=best.is_bound,
        level_with=list(dict.fromkeys(level)),
    )


def _within(candidates: Sequence[Candidate], cost: str, budget: float) -> BudgetRecord:
    best: dict[str, Candidate] = {}
    for one in candidates:
        if one.costs[cost] <= budget and (one.system not in best or one.rel_mse < best[one.system].rel_mse):
            best[one.system] = one
    least = min(best.values(), key=lambda one: one.rel_mse, default=None)
    rows = {
        name: BestRecord(
            label=one.label,
            rel_mse=one.rel_mse,
            is_bound=one.is_bound,
            is_least=least is not None and one.is_level_with(least),
        )
        for name, one in best.items()
    }
    return BudgetRecord(budget=budget, best=rows)

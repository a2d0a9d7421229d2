"""Pareto fronts over error and cost, with a dominating point for every other point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Front:
    """A front over points with an error and a cost.

    Attributes
    ----------
    on : tuple of int
        Indices of the points on the front, by rising cost and so by falling error.
    dominated : dict of int to int
        Every other point, and one on the front that costs no more and errs no more.
    """

    on: tuple[int, ...]
    dominated: dict[int, int]


def front_of(costs: Sequence[float], errors: Sequence[float]) -> Front:
    """Find the Pareto front.

    Parameters
    ----------
    costs, errors : sequence of float
        One of each a point; less is better in both.

    Returns
    -------
    Front
        Of points that are equal in both, the first is on the front. A point that is dominated names that point of the
        front with the least error among those that cost no more: what to take instead.
    """
    order = sorted(range(len(costs)), key=lambda index: (costs[index], errors[index], index))
    on: list[int] = []
    dominated: dict[int, int] = {}
    for index in order:
        if not on or errors[index] < errors[on[-1]]:
            on.append(index)
        else:
            dominated[index] = on[-1]
    return Front(tuple(on), dominated)

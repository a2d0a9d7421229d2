"""Promises of a bake, each with the value that was reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rsibr.store.manifest import Manifest


@dataclass(frozen=True)
class Promise:
    """An upper limit that a bake was asked to keep.

    Attributes
    ----------
    key : str
        Key of the config that asks for it: "sampling.target_error", "sampling.time_budget_s", "budget.error" or
        "budget.seconds".
    promised : float
        Limit: relMSE, or seconds.
    reached : float or None
        Measured value; None if it could not be measured, as of maps that are not finite.
    ci95 : pair of float or None
        Confidence interval of `reached`, where one is known.
    """

    key: str
    promised: float
    reached: float | None
    ci95: tuple[float, float] | None = None

    @property
    def kept(self) -> bool:
        """Whether the reached value is within the limit."""
        return self.reached is not None and self.reached <= self.promised

    @property
    def unit(self) -> str:
        """Unit of the values, with a space before it; empty for relMSE."""
        return " s" if self.key in ("sampling.time_budget_s", "budget.seconds") else ""

    def __str__(self) -> str:
        """Return promise and value in words: `budget.seconds: promised 5 s, reached 7.2 s`."""
        reached = "not measurable" if self.reached is None else f"reached {self.reached:.3g}{self.unit}"
        return f"{self.key}: promised {self.promised:.3g}{self.unit}, {reached}"


def promises_of(manifest: Manifest) -> tuple[Promise, ...]:
    """Return all promises of a finished bake.

    Parameters
    ----------
    manifest : Manifest
        Of a finished bake.

    Examples
    --------
    >>> [promise.key for promise in promises_of(bake.manifest) if not promise.kept]          # doctest: +SKIP
    []
    """
    sampling, budget, found = manifest.sampling, manifest.budget, list[Promise]()
    if sampling is not None and sampling.promised_rel_mse is not None:
        found.append(Promise("sampling.target_error", sampling.promised_rel_mse, manifest.noise))
    if sampling is not None and sampling.promised_seconds is not None and budget is None:
        found.append(Promise("sampling.time_budget_s", sampling.promised_seconds, manifest.total_seconds))
    if budget is not None and budget.promised_error is not None:
        found.append(Promise("budget.error", budget.promised_error, budget.reached_error, budget.reached_ci95))
    if budget is not None and budget.promised_seconds is not None:
        found.append(Promise("budget.seconds", budget.promised_seconds, budget.reached_seconds))
    return tuple(found)

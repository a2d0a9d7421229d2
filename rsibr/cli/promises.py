"""Promised, chosen and reached values of a bake, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from rsibr.budget.promise import Promise, promises_of
from rsibr.cli.streams import alarm

if TYPE_CHECKING:
    from rsibr.store.manifest import BudgetRecord, Manifest, SamplingRecord


def promises(manifest: Manifest) -> dict[str, Any]:
    """Keys of `rsibr bake --json`: samples, noise, and each promise with the reached value."""
    sampling, budget = manifest.sampling, manifest.budget
    told: dict[str, Any] = {"samples": manifest.samples, "noise_rel_mse": manifest.noise}
    if sampling is not None:
        told["adaptive"] = sampling.scale is not None
    if budget is not None and budget.promised_error is None:
        found = {"forecast": budget.forecast_error, "reached": budget.reached_error, "ci95": budget.reached_ci95}
        told["budget"] = {"error": found}
    for promise in promises_of(manifest):
        section, _, key = promise.key.partition(".")
        values: dict[str, Any] = {"promised": promise.promised, "reached": promise.reached, "kept": promise.kept}
        if promise.ci95 is not None:
            values["ci95"] = promise.ci95
        if section == "budget":
            told.setdefault("budget", {})[key] = values
        else:
            told[key] = values
    return told


def exit_code(promises: Iterable[Promise]) -> int:
    """Print each broken promise to stderr; return the exit code of the command: 1 if there is one, else 0."""
    code = 0
    for promise in promises:
        if not promise.kept:
            alarm(f"broken promise: {promise}")
            code = 1
    return code


def chosen_lines(sampling: SamplingRecord | None, budget: BudgetRecord | None) -> Iterator[str]:
    """Yield lines on the choices of a target error, a time or a budget, before a bake."""
    if budget is not None:
        size = f"{budget.chosen.views} maps of {budget.chosen.resolution}²"
        yield f"budget: {size}, relMSE at most {budget.forecast_error:.2g}; {len(budget.probes)} probes took " + (
            f"{budget.choice_seconds:.1f} s"
        )
    if sampling is not None:
        yield f"samples: {sampling.samples} a texel{_steered(sampling)}, noise {sampling.forecast_rel_mse or 0:.2g}"


def reached_lines(manifest: Manifest) -> Iterator[str]:
    """Yield lines on each promise of a finished bake, with the reached value."""
    sampling, budget = manifest.sampling, manifest.budget
    if sampling is not None and (sampling.scale is not None or sampling.promised_rel_mse or sampling.promised_seconds):
        yield f"samples: {sampling.samples} a texel{_steered(sampling)}"
    if sampling is not None and sampling.promised_rel_mse is not None:
        reached = "unknown" if manifest.noise is None else f"{manifest.noise:.3g}"
        yield f"noise (relMSE): promised {sampling.promised_rel_mse:.3g}, reached {reached}"
    if sampling is not None and sampling.promised_seconds is not None and budget is None:
        yield f"time: promised {sampling.promised_seconds:.3g} s, reached {manifest.total_seconds:.3g} s"
    if budget is not None and budget.promised_seconds is not None:
        yield f"time: promised {budget.promised_seconds:.3g} s, reached {budget.reached_seconds or 0:.3g} s"
    if budget is not None and budget.reached_error is not None:
        asked = "expected" if budget.promised_error is None else "promised"
        low, high = budget.reached_ci95 or (0.0, 0.0)
        yield (
            f"error of a new view (relMSE): {asked} {budget.promised_error or budget.forecast_error:.3g}, "
            f"reached {budget.reached_error:.3g} ({low:.2g} to {high:.2g})"
        )


def _steered(sampling: SamplingRecord) -> str:
    return "" if sampling.scale is None else " on average, allocated by noise"

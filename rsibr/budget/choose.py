"""Choice of resolution, views and samples within a budget for the whole bake, by quick probes."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rsibr.baking.calibration import map_overhead, sample_seconds
from rsibr.baking.scene import Scene
from rsibr.budget.probe import ProbedScene
from rsibr.errors import InputError
from rsibr.planning.fit import unfitted_advice
from rsibr.scene.config import Config, MapConfig, SamplingConfig, ViewsConfig
from rsibr.store.manifest import BudgetRecord, ProbeRecord

RESOLUTIONS = (64, 128, 256, 512)
SUBDIVISIONS = (0, 1, 2, 3)

BIAS_SHARE = 0.75
"""Maximum share of a promised error for the bias. With less left for noise, samples would cost more than views."""

NOISE_MARGIN = 1.15
"""Safety factor on the number of samples that the probed noise requires."""

NEGLIGIBLE_NOISE = 0.05
"""Ratio of noise to bias below which more samples have no visible effect."""

PROBING_SHARE = 0.2
"""Maximum share of a time budget for probes."""

LEAST_SAMPLES = 64
MOST_SAMPLES = 2**16

_PROBE_OVERHEAD = 0.5  # seconds of a probe besides sampling, measured on two cores

_SIZE = 16  # samples a block in timing measurements


@dataclass(frozen=True)
class Size:
    """Candidate: texels a side, and views."""

    resolution: int
    views: ViewsConfig


def choose(scene: Scene, begun: float) -> tuple[Config, BudgetRecord]:
    """Choose the parameters that a config with a budget leaves open, by quick probes.

    Parameters
    ----------
    scene : Scene
        Scene of a config with a budget. Resolution, views and samples that the config sets are kept.
    begun : float
        Start of the work, by `time.perf_counter`; the time of the choice counts from it.

    Returns
    -------
    config : Config
        Config to bake, without a budget.
    record : BudgetRecord
        Promised, probed and chosen values.

    Raises
    ------
    InputError
        If the budget cannot be met; the message says what is possible.
    """
    config, budget = scene.config, scene.config.budget
    if budget is None:
        raise ValueError("the config has no budget")
    probed = ProbedScene(scene)
    if budget.error is not None:
        size, found, probes = _size_for_error(probed, budget.error)
        samples = _samples_for(found, budget.error, config)
        sampling = _with_samples(config.sampling, samples=samples)
    else:
        size, found, probes, samples = _size_for_seconds(probed, float(budget.seconds or 0.0), begun)
        enough = _negligible(found)
        sampling = config.sampling
        if sampling.samples == "auto" and samples > enough:
            sampling = _with_samples(sampling, samples=enough)
        elif sampling.samples == "auto":
            left = float(budget.seconds or 0.0) - (time.perf_counter() - begun)
            sampling = _with_samples(sampling, time_budget_s=left)
        samples = min(samples, enough)
    changed = {"map": MapConfig(resolution=size.resolution), "views": size.views, "sampling": sampling, "budget": None}
    resolved = config.model_copy(update=changed)
    record = BudgetRecord(
        asked=config.to_dict(),
        resolved=resolved.to_dict(),
        promised_error=budget.error,
        promised_seconds=budget.seconds,
        chosen=found,
        probes=tuple(probes),
        forecast_error=found.upper + found.noise * found.samples / samples,
        choice_seconds=max(0.0, time.perf_counter() - begun),
    )
    return resolved, record


def _sizes(scene: ProbedScene) -> Iterator[Size]:
    """Yield candidates in ascending order of work; parameters that the config sets are fixed."""
    config = scene.config
    resolutions = RESOLUTIONS if config.map.resolution == "auto" else (config.map.resolution,)
    open_views = config.views.is_open and scene.plan.needs_views
    views = [ViewsConfig(subdivision=level) for level in SUBDIVISIONS] if open_views else [config.views]
    every = [Size(resolution, one) for resolution in resolutions for one in views]
    yield from sorted(every, key=lambda size: size.resolution**2 * len(scene.viewpoints(size.views)))


def _size_for_error(scene: ProbedScene, error: float) -> tuple[Size, ProbeRecord, list[ProbeRecord]]:
    probes: list[ProbeRecord] = []
    for size in _sizes(scene):
        found = scene.probe(size.resolution, scene.viewpoints(size.views))
        probes.append(found)
        if found.upper <= BIAS_SHARE * error and _fits(found, error, scene.config):
            return size, found, probes
    best = min(probes, key=lambda probe: probe.upper)
    raise InputError(
        f"an error of {error:g} cannot be promised: the smallest possible is {best.upper / BIAS_SHARE:.3g}, "
        f"with {best.views} maps of {best.resolution}²{unfitted_advice(scene.plan)}",
        where="budget.error",
        fix="allow for more error, or leave map.resolution, views and sampling.samples open",
    )


def _fits(found: ProbeRecord, error: float, config: Config) -> bool:
    """Whether bias and noise stay below the error, with the given samples or with at most `MOST_SAMPLES`."""
    if config.sampling.samples != "auto":
        return found.upper + NOISE_MARGIN * found.noise * found.samples / config.sampling.samples <= error
    return NOISE_MARGIN * found.noise * found.samples / (error - found.upper) <= MOST_SAMPLES


def _samples_for(found: ProbeRecord, error: float, config: Config) -> int:
    if config.sampling.samples != "auto":
        return config.sampling.samples
    needed = NOISE_MARGIN * found.noise * found.samples / (error - found.upper)
    return max(LEAST_SAMPLES, math.ceil(needed))


def _negligible(found: ProbeRecord) -> int:
    """Samples a texel beyond which noise is negligible compared with bias."""
    matters = found.noise * found.samples / (NEGLIGIBLE_NOISE * max(found.bias, 1e-9))
    return int(np.clip(matters, LEAST_SAMPLES, MOST_SAMPLES))


def _size_for_seconds(
    scene: ProbedScene, seconds: float, begun: float
) -> tuple[Size, ProbeRecord, list[ProbeRecord], int]:
    """Most accurate of the candidates that can be probed in time, with the samples that fit into the remaining time."""
    probes: list[ProbeRecord] = []
    best: tuple[float, Size, ProbeRecord] | None = None
    rate = sample_seconds(scene.integrator, _SIZE)
    for size in _sizes(scene):
        viewpoints = scene.viewpoints(size.views)
        ahead = rate * scene.work(size.resolution, viewpoints) + _PROBE_OVERHEAD
        if probes and time.perf_counter() - begun + ahead > PROBING_SHARE * seconds:
            break
        found = scene.probe(size.resolution, viewpoints)
        probes.append(found)
        samples = _affordable(scene, found, rate, seconds)
        if samples < LEAST_SAMPLES:
            break
        expected = found.upper + found.noise * found.samples / min(samples, _negligible(found))
        if best is None or expected < best[0]:
            best = expected, size, found
    if best is None:
        raise InputError(
            f"{seconds:g} s are too few for {probes[0].views} maps of {probes[0].resolution}²",
            where="budget.seconds",
            fix="allow for more, or set a lower map.resolution",
        )
    _, size, found = best
    return size, found, probes, max(LEAST_SAMPLES, int(_affordable(scene, found, rate, seconds)))


def _affordable(scene: ProbedScene, found: ProbeRecord, rate: float, seconds: float) -> float:
    """Samples a texel that fit into a time budget; if the config sets them, that number, or 0 if it does not fit."""
    integrator = scene.integrator.at_resolution(found.resolution)
    left = (1 - PROBING_SHARE) * seconds - found.views * map_overhead(integrator)
    samples = left / (rate * np.count_nonzero(integrator.coverage) * found.views)
    given = scene.config.sampling.samples
    if given != "auto":
        return float(given) if samples >= given else 0.0
    return float(samples)


def _with_samples(sampling: SamplingConfig, **count: float) -> SamplingConfig:
    plain = sampling.model_dump(exclude={"samples", "target_error", "time_budget_s"}, exclude_none=True)
    return SamplingConfig.model_validate({**plain, **count})

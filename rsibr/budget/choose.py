"""A budget of the whole bake: the tool chooses resolution, views and samples, and says what it promised and reached."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.baking.baker import Progress
from rsibr.baking.baker import bake as run_bake
from rsibr.baking.calibration import map_overhead, sample_seconds
from rsibr.baking.forecast import forecast
from rsibr.budget.probe import ProbedScene
from rsibr.budget.reached import reached_error
from rsibr.errors import BakeError, InputError
from rsibr.planning.plan import Plan
from rsibr.scene.config import Config, MapConfig, SamplingConfig, ViewsConfig, load_config
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.directory import claim_directory
from rsibr.store.manifest import MANIFEST_NAME, BudgetRecord, Manifest, ProbeRecord, SamplingRecord, read_manifest

RESOLUTIONS = (64, 128, 256, 512)
SUBDIVISIONS = (0, 1, 2, 3)

BIAS_SHARE = 0.75
"""Share of a promised error that the bias may take: with less left to the noise, samples cost more than views do."""

NOISE_MARGIN = 1.15
"""Samples to those that the probe's noise calls for."""

NEGLIGIBLE_NOISE = 0.05
"""Noise to the bias below which more samples buy nothing that anyone could see."""

PROBING_SHARE = 0.2
"""Share of a budget of seconds that goes into probes at most."""

LEAST_SAMPLES = 64
MOST_SAMPLES = 2**16

_PROBE_OVERHEAD = 0.5  # seconds of a probe beside its samples, measured on two cores

_SIZE = 16  # samples of the blocks that time is measured with


@dataclass(frozen=True)
class Size:
    """A candidate: texels a side, and views."""

    resolution: int
    views: ViewsConfig


@backend.in_session
def bake(
    config: Config | Path | str,
    *,
    out: Path | str,
    overrides: Sequence[str] = (),
    fresh: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Bake:
    """Bake the radiance sphere maps of all views, within the config's budget where it has one.

    A bake that was killed goes on where it was and ends bit-identical to one that never was: what a budget decided is
    recorded before the first view and not decided again.

    Parameters
    ----------
    config, out, overrides, fresh, on_progress
        See `rsibr.baking.baker.bake`.

    Returns
    -------
    Bake
        The finished bake, opened and checked. `bake.manifest.budget` and `bake.manifest.sampling` say what was
        promised, chosen and reached.

    Raises
    ------
    InputError
        If the config, the environment, the material or the views are wrong, or a budget cannot be kept.
    BakeError
        If `out` holds something else, a bake of another config, or one that another process is writing.
    MachineError
        If the machine has no usable backend, or the disk is full.
    """
    settings = config if isinstance(config, Config) else load_config(Path(config), overrides)
    if settings.budget is None:
        return run_bake(settings, out=out, fresh=fresh, on_progress=on_progress)
    path = Path(out)
    claim_directory(path)
    sized, record = (None if fresh else _recorded(path, settings)) or choose(settings)
    baked = run_bake(sized, out=path, fresh=fresh, on_progress=on_progress, budget=record)
    if baked.manifest.budget and baked.manifest.budget.reached_seconds is None:
        _record_reached(baked, settings)
    return open_bake(path)


@backend.in_session
def plan(config: Config | Path | str, *, overrides: Sequence[str] = ()) -> Plan:
    """Say what a bake would simulate, of the size that its budget would choose; see `rsibr.baking.forecast.plan`."""
    return planned(config if isinstance(config, Config) else load_config(Path(config), overrides))[0]


def planned(settings: Config) -> tuple[Plan, SamplingRecord | None, BudgetRecord | None]:
    """Plan, and what a target, a time or a budget would choose. Nothing is baked."""
    resolved, record = (settings, None) if settings.budget is None else choose(settings)
    return (*forecast(resolved), record)


def choose(config: Config) -> tuple[Config, BudgetRecord]:
    """Choose what a budget leaves open, by quick probes.

    Parameters
    ----------
    config : Config
        With a budget. What it sets itself of resolution, views and samples stays.

    Returns
    -------
    config : Config
        Without a budget: what to bake.
    record : BudgetRecord
        What was promised, probed and chosen.

    Raises
    ------
    InputError
        If the budget cannot be kept; it says what could.
    """
    begun, budget = time.perf_counter(), config.budget
    if budget is None:
        raise ValueError("the config has no budget")
    scene = ProbedScene(config)
    if budget.error is not None:
        size, found, probes = _size_for_error(scene, budget.error)
        samples = _samples_for(found, budget.error, config)
        sampling = _with_samples(config.sampling, samples=samples)
    else:
        size, found, probes, samples = _size_for_seconds(scene, float(budget.seconds or 0.0), begun)
        enough = _negligible(found)
        left = float(budget.seconds or 0.0) - (time.perf_counter() - begun)
        given = "samples" in config.sampling.model_fields_set
        sampling = (
            config.sampling
            if given
            else _with_samples(config.sampling, samples=enough)
            if samples > enough
            else _with_samples(config.sampling, time_budget_s=left)
        )
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
    """Candidates, the least work first; what the config sets itself is no question."""
    config = scene.config
    given = "resolution" in config.map.model_fields_set
    resolutions = (config.map.resolution,) if given else RESOLUTIONS
    open_views = not config.views.model_fields_set and scene.plan.needs_views
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
        f"an error of {error:g} cannot be promised here: the best that can be is {best.upper / BIAS_SHARE:.3g}, "
        f"with {best.views} maps of {best.resolution}²",
        where="budget.error",
        fix="allow for more error, or leave map.resolution, views and sampling.samples open",
    )


def _fits(found: ProbeRecord, error: float, config: Config) -> bool:
    """Whether the noise can be brought below what the bias leaves, by the samples given or by as many as it takes."""
    if "samples" in config.sampling.model_fields_set:
        return found.upper + NOISE_MARGIN * found.noise * found.samples / config.sampling.samples <= error
    return NOISE_MARGIN * found.noise * found.samples / (error - found.upper) <= MOST_SAMPLES


def _samples_for(found: ProbeRecord, error: float, config: Config) -> int:
    if "samples" in config.sampling.model_fields_set:
        return config.sampling.samples
    needed = NOISE_MARGIN * found.noise * found.samples / (error - found.upper)
    return max(LEAST_SAMPLES, math.ceil(needed))


def _negligible(found: ProbeRecord) -> int:
    """Samples a texel beyond which the noise no longer matters beside the bias."""
    matters = found.noise * found.samples / (NEGLIGIBLE_NOISE * max(found.bias, 1e-9))
    return int(np.clip(matters, LEAST_SAMPLES, MOST_SAMPLES))


def _size_for_seconds(
    scene: ProbedScene, seconds: float, begun: float
) -> tuple[Size, ProbeRecord, list[ProbeRecord], int]:
    """The most accurate of the candidates that can be probed in time, with the samples that it leaves time for."""
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
    """Samples a texel that a budget of seconds leaves time for; where the config sets them, whether it does."""
    integrator = scene.integrator.at_resolution(found.resolution)
    left = (1 - PROBING_SHARE) * seconds - found.views * map_overhead(integrator)
    samples = left / (rate * np.count_nonzero(integrator.coverage) * found.views)
    config = scene.config.sampling
    if "samples" in config.model_fields_set:
        return float(config.samples) if samples >= config.samples else 0.0
    return float(samples)


def _with_samples(sampling: SamplingConfig, **count: float) -> SamplingConfig:
    plain = sampling.model_dump(exclude={"samples", "target_error", "time_budget_s"}, exclude_none=True)
    return SamplingConfig.model_validate({**plain, **count})


def _recorded(path: Path, config: Config) -> tuple[Config, BudgetRecord] | None:
    """What was chosen for the bake that is there."""
    if not (path / MANIFEST_NAME).exists():
        return None
    found = read_manifest(path / MANIFEST_NAME)
    if found.budget is None or found.budget.asked != config.to_dict():
        what = "holds a bake of another config or budget"
        raise BakeError(what, where=str(path), fix="use --fresh to bake anew, or another --out")
    return Config.model_validate(found.budget.resolved), found.budget


def _record_reached(baked: Bake, config: Config) -> None:
    """Measure the error of a finished bake, and keep it with the time it took."""
    found = reached_error(baked, config)

    def told(manifest: Manifest | None) -> Manifest:
        if manifest is None or manifest.budget is None:
            raise ValueError("the bake has no budget")
        seconds = manifest.budget.choice_seconds + manifest.total_seconds
        reached = {"reached_error": found.value, "reached_ci95": found.ci95, "reached_seconds": seconds}
        return manifest.model_copy(update={"budget": manifest.budget.model_copy(update=reached)})

    with BakeWriter.open(baked.path, told):
        pass  # what is told is on the disk

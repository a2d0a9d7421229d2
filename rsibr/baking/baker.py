"""Bake of a config: all views, in blocks of samples, into a directory from which a killed bake resumes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr import backend, clock
from rsibr.baking.baked_costs import baked_costs
from rsibr.baking.blocks import Blocks, estimate
from rsibr.baking.finished import DECISIVE, SOURCE, baking_code, finished_bake, package_versions
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.job import disk_and_memory, with_time
from rsibr.baking.lobe_record import lobe_record
from rsibr.baking.sampling import Sampler, Steering
from rsibr.baking.scene import Scene
from rsibr.errors import CheckFailed
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.job_size import JobSize
from rsibr.planning.costs import priced
from rsibr.planning.plan import Plan
from rsibr.progress import Progress
from rsibr.scene.config import ConfigLike, config_of
from rsibr.scene.material import ANISOTROPIC, VARYING, Material
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.layers import layered
from rsibr.store.manifest import (
    BudgetRecord,
    EnvironmentRecord,
    Manifest,
    MaterialRecord,
    SamplingRecord,
)
from rsibr.store.map_file import MapFile
from rsibr.store.soundness import fault_of

REFLECTS = 1e-6
"""Albedo above which black maps are a fault under a light that shines."""

NO_GLINT = "its mirror lobe shows no light without extent: their reflection is a point of no size"
"""Note on a delta lobe under a delta light."""

RETROREFLECTIVE = "retroreflective: no warp reproduces retroreflection; expect larger errors between the stored views"


@backend.in_session
def bake(
    config: ConfigLike | Scene,
    *,
    out: Path | str,
    overrides: Sequence[str] = (),
    fresh: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
    budget: BudgetRecord | None = None,
    steering: Steering | None = None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
) -> Bake:
    """Bake the radiance sphere maps of all views.

    A killed bake resumes, and its result is bit-identical to that of an uninterrupted one. A complete bake is opened
    and returned.

    Parameters
    ----------
    config : Config, mapping, path or Scene
        A config, its tables as a mapping, a path to a TOML file, or a prepared scene.
    out : path
        Directory of the bake, by convention `NAME.rsibr`. Created if it does not exist.
    overrides : sequence of str
        `key=value` pairs that override keys of the config, like `--set`.
    fresh : bool
        Start over if `out` holds a damaged bake or one of another config.
    on_progress : callable
        Called after each launch and each view; never if the bake is complete.
    budget : BudgetRecord, optional
        Choice of a budget for the whole bake from which `config` was made.
    steering : Steering, optional
        Thresholds of adaptive sample allocation.
    on_forecast : callable
        Called once with bytes, memory and time of the bake before its first view; never if the bake is complete.
    allow_large : bool
        Start even if the bake exceeds the free disk space or memory.

    Returns
    -------
    Bake
        Finished bake, opened and verified.

    Raises
    ------
    InputError
        If the config, the environment, the material or the views are invalid, or the bake exceeds the free disk space
        or memory, unless `allow_large`.
    BakeError
        If `out` holds other files, a bake of another config, or one that another process is writing.
    MachineError
        If the machine has no usable backend, or the disk is full.
    CheckFailed
        If the maps are finished and of no use: largely not finite, or black although there is light and the material
        reflects. They are kept.
    """
    on_progress, on_forecast = backend.unlocked(on_progress), backend.unlocked(on_forecast)
    with clock.counting() as begun:
        prepared = config if isinstance(config, Scene) else None
        settings = config.config if isinstance(config, Scene) else config_of(config, overrides)
        if settings.budget is not None:
            raise ValueError("a budget must be resolved before the bake")
        if not fresh and (found := finished_bake(settings, out, prepared.digests if prepared else None)) is not None:
            return found
        scene = prepared or Scene.prepare(settings)
        job = disk_and_memory(scene, Path(out))
        job.admit(out, allow_large)

        def started(sampling: SamplingRecord, views: int) -> None:
            on_forecast(with_time(job, scene, sampling, views))

        return _bake_scene(scene, Path(out), begun, fresh, started, on_progress, budget, steering or Steering())


def _bake_scene(
    scene: Scene,
    out: Path,
    begun: float,
    fresh: bool,
    on_start: Callable[[SamplingRecord, int], None],
    on_progress: Callable[[Progress], None],
    budget: BudgetRecord | None,
    steering: Steering,
) -> Bake:
    sampler = Sampler(scene.integrator, scene.frames, scene.config.sampling, steering)
    if scene.config.sampling.time_budget_s is not None:
        _ = scene.light  # made before the samples are chosen, so that its time counts toward the budget
    with backend.rendering(scene.rendering):

        def manifest(found: Manifest | None) -> Manifest:
            _ = scene.stored_lobes  # made now, so that their time counts as set-up, before the first view
            sampling = (found.sampling if found else None) or sampler.choose(begun)
            return plan_manifest(scene, scene.viewpoints, sampling, budget)

        with BakeWriter.open(out, manifest, fresh=fresh) as writer:
            is_finished = writer.has_light and not writer.pending  # only what the manifest records has changed
            if not writer.has_light:
                writer.commit_light(scene.light)
            if writer.pending and writer.manifest.sampling is not None:
                on_start(writer.manifest.sampling, len(writer.pending))
            _bake_views(writer, sampler, on_progress)
            _record_end(writer, scene, time.perf_counter() if is_finished else begun)
    return _sound(open_bake(out), scene)


def _sound(baked: Bake, scene: Scene) -> Bake:
    """Return the finished bake; raise if its maps as a whole are unusable. Its files stay, so that they can be seen."""

    def should_shine() -> bool:
        kept = [lobe for lobe in scene.parts.probes.material.lobes if lobe.name not in scene.plan.left_out]
        return not baked.light.is_black and any(lobe.albedo.max() > REFLECTS for lobe in kept)

    fault = fault_of(baked.manifest, should_shine)
    if not fault:
        return baked
    raise CheckFailed(
        f"baked, and of no use: {fault}",
        where=str(baked.path),
        fix=f"check how {scene.material.name} evaluates and samples ({scene.environment.name} is the light); "
        f"the maps are kept, and `rsibr check {baked.path}` shows where",
    )


def _record_end(writer: BakeWriter, scene: Scene, begun: float) -> None:
    """Record the costs of the bake."""
    seconds = max(0.0, time.perf_counter() - begun)  # never negative, even if the clock jumps
    costs = baked_costs(writer.manifest, len(scene.all_around), writer.manifest.wall_seconds + seconds)
    writer.record_end(priced(scene.plan, costs, scene.config.map.side), seconds)


def plan_manifest(
    scene: Scene, viewpoints: Viewpoints, sampling: SamplingRecord, budget: BudgetRecord | None = None
) -> Manifest:
    """Manifest of the bake before its first view: all inputs that determine the bits of its maps."""
    environment, material, plan, packages = scene.environment, scene.material, scene.plan, package_versions()
    return Manifest.planned(
        config=scene.config.to_dict() if budget is None else budget.asked,
        identity={
            "config": scene.identifying_config,
            "environment": {"name": environment.name, "content": environment.digest},
            "material": {"name": material.name, "content": material.digest},
            "packages": {name: packages[name] for name in DECISIVE},
            SOURCE: baking_code(),
            "variant": scene.variant,
            "blocks": sampling.identity,
            "plan": {"grey": plan.grey, "light_samples": plan.light_samples, "left_out": list(plan.left_out)},
            "lobe_views": {lobe.name: lobe.own_views for lobe in plan.lobes if lobe.own_views is not None},
        },
        packages=packages,
        variant=scene.variant,
        environment=EnvironmentRecord(name=environment.name, clipped=environment.clipped, lowest=environment.lowest),
        material=MaterialRecord(
            name=material.name, warp=material.warp, notes=_notes(material, plan, scene.parts.probes.light.is_delta)
        ),
        lobes=tuple(lobe_record(lobe, plan) for lobe in scene.stored_lobes),
        resolution=scene.resolution,
        directions=viewpoints.directions,
        triangles=viewpoints.triangles,
        plan=plan,
        sampling=sampling,
        budget=budget,
    )


def _notes(material: Material, plan: Plan, delta_light: bool) -> tuple[str, ...]:
    """Properties of the material that no warp reproduces; shown by the bake and by every report on it."""
    found = {"retroreflection": RETROREFLECTIVE, "anisotropy": ANISOTROPIC, "spatial_variation": VARYING}
    flagged = [note for name, note in found.items() if plan[name].missed]
    if delta_light and plan["mirror"].on:
        flagged.append(NO_GLINT)
    return tuple(dict.fromkeys([*material.notes, *flagged]))  # no duplicates: Mitsuba may report anisotropy too


def _bake_views(writer: BakeWriter, sampler: Sampler, on_progress: Callable[[Progress], None]) -> None:
    pending, views, record = writer.pending, len(sampler.frames), writer.manifest.sampling
    if not pending or record is None:
        return
    lobes = writer.manifest.lobes
    with ThreadPoolExecutor(1) as storing:  # the device renders the next view while the last one is written
        stored = storing.submit(lambda: None)
        for finished, index in enumerate(pending, start=views - len(pending)):
            start = time.perf_counter()

            def report(share: float, views_done: int = finished) -> None:
                on_progress(Progress(views_done + share, views, f"view {views_done + 1}", share))

            blocks, frame = sampler.blocks(record, index), sampler.frames[index]
            seed = sampler.config.seed
            baked = bake_view(sampler.integrator, frame, blocks, seed=seed, index=index, on_launch=report)
            seconds = max(0.0, time.perf_counter() - start)  # never negative, even if the clock jumps
            stored.result()  # raises if the last view could not be written
            stored = storing.submit(writer.commit, index, layered(baked, lobes, index), seconds)
        stored.result()
    on_progress(Progress(views, views, "done", 1.0))


def bake_view(
    integrator: SphereIntegrator,
    frame: NDArray[np.float64],
    blocks: Blocks,
    *,
    seed: int,
    index: int,
    on_launch: Callable[[float], None] = lambda _: None,
) -> MapFile:
    """Bake one view: a pure function of the scene, the view and the seed.

    Parameters
    ----------
    integrator : SphereIntegrator
        Scene and resolution.
    frame : ndarray, shape (3, 3)
        Frame of the map, columns x, y, v.
    blocks : Blocks
        Blocks of each texel, fixed before any of these samples is drawn; see `block_sizes`.
    seed, index : int
        Root of the seed tree, and branch of the view.
    on_launch : callable
        Called with the fraction of the work done.

    Returns
    -------
    MapFile
        Mean over the blocks with a layer for each lobe, and the variance of the mean of their sum.
    """
    seeds = np.random.SeedSequence(seed, spawn_key=(index,))
    lobes, variance = estimate(integrator, frame, blocks, seeds, on_launch)
    return MapFile(
        view=frame[:, 2].copy(),
        frame=frame,
        layers={name: integrator.image(lobes[:, k]) for k, name in enumerate(integrator.lobe_names)},
        variance=integrator.image(variance),
        coverage=integrator.coverage,
        grey=integrator.grey,
    )

"""Bakes a config: every view, in blocks of samples, into a directory that survives being killed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rsibr
from rsibr import backend
from rsibr.baking.blocks import Blocks, block_sizes, estimate
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.planning import (
    baked_costs,
    planned_integrator,
    planned_lobes,
    planned_scene,
    planned_settings,
    planned_viewpoints,
)
from rsibr.baking.sampling import Sampler
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.light.radiance import Light, light_of
from rsibr.lobes.adaptation import adapted_lobes
from rsibr.lobes.split import Lobe
from rsibr.planning.costs import priced
from rsibr.planning.plan import Plan
from rsibr.scene.config import Config, load_config
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.material import ANISOTROPIC, Material, load_material
from rsibr.scene.views import load_viewpoints
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.layers import layered
from rsibr.store.lobe_shape import shape_of
from rsibr.store.manifest import (
    BudgetRecord,
    EnvironmentRecord,
    LobeRecord,
    Manifest,
    MaterialRecord,
    ProxyRecord,
    SamplingRecord,
)
from rsibr.store.map_file import MapFile

STEPS = 16
"""Steps of the progress of a view."""

RETROREFLECTIVE = (
    "retroreflective: no warp follows light that goes back, so that expect larger errors between the views"
)


@dataclass(frozen=True)
class Progress:
    """How far a bake has come.

    Attributes
    ----------
    views_done, views : int
        Views finished, and in all.
    blocks_done, blocks : int
        Steps of the view at work, finished and in all.
    """

    views_done: int
    views: int
    blocks_done: int
    blocks: int


def bake(
    config: Config | Path | str,
    *,
    out: Path | str,
    overrides: Sequence[str] = (),
    fresh: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
    budget: BudgetRecord | None = None,
) -> Bake:
    """Bake the radiance sphere maps of all views.

    A bake that was killed goes on where it was and ends bit-identical to one that never was.

    Parameters
    ----------
    config : Config or path
        What to bake; a path to a TOML file, or a config already read.
    out : path
        Directory of the bake, by custom `NAME.rsibr`. Made if need be.
    overrides : sequence of str
        `key=value` pairs that override keys of the config file, as `--set` does.
    fresh : bool
        Start anew where `out` holds a bake of another config, or a damaged one.
    on_progress : callable
        Called after each launch and each view.
    budget : BudgetRecord, optional
        What a budget of the whole bake chose, of which `config` came; see `rsibr.budget.choose`.

    Returns
    -------
    Bake
        The finished bake, opened and checked.

    Raises
    ------
    InputError
        If the config, the environment, the material or the views are wrong.
    BakeError
        If `out` holds something else, a bake of another config, or one that another process is writing.
    MachineError
        If the machine has no usable backend, or the disk is full.
    """
    begun = time.perf_counter()
    settings = config if isinstance(config, Config) else load_config(Path(config), overrides)
    if settings.budget is not None:
        raise ValueError("rsibr.budget.choose decides on a budget")
    backend.use()
    environment, material = load_environment(settings.environment), load_material(settings.material)
    plan, probed = planned_scene(settings, environment, material.bsdf(), block_sizes(settings.sampling.samples).size)
    asked, settings = settings.map.resolution, planned_settings(settings, plan)
    all_around = load_viewpoints(settings.views)
    viewpoints = planned_viewpoints(all_around, settings, plan)
    split = None if settings.effects.lobes == "off" else probed
    lobes = adapted_lobes(split, environment, material, plan.rendering) if split else ()
    integrator = planned_integrator(settings, environment, material, split, plan, plan.resolution)
    with backend.rendering(plan.rendering) as variant:
        sampler = Sampler(integrator, [view_frame(view) for view in viewpoints.directions], settings.sampling)

        def manifest(found: Manifest | None) -> Manifest:
            sampling = (found.sampling if found else None) or sampler.choose(begun)
            return plan_manifest(settings, environment, material, lobes, viewpoints, variant, plan, sampling, budget)

        with BakeWriter.open(Path(out), manifest, fresh=fresh) as writer:
            if not writer.has_light:
                writer.commit_light(planned_light(environment, lobes, plan))
            _bake_views(writer, sampler, on_progress)
            writer.record_plan(priced(plan, baked_costs(writer.manifest, len(all_around)), asked))
    return open_bake(Path(out))


def planned_light(environment: Environment, lobes: Sequence[Lobe], plan: Plan) -> Light:
    """The light with what the lobes look up in it; an image is RGB from the start, however the maps are rendered."""
    shapes = [shape_of(_lobe_record(lobe, plan)) for lobe in planned_lobes(lobes, plan)]
    with backend.rendering("rgb" if environment.width else plan.rendering):
        light = light_of(environment, with_image=any(lobe.is_mirror for lobe in lobes))
    return light.with_tables(
        glossy=any(not shape.is_matte and not shape.is_mirror for shape in shapes),
        matte=[shape.matte for shape in shapes if shape.is_matte],
    )


def plan_manifest(
    config: Config,
    environment: Environment,
    material: Material,
    kept_apart: Sequence[Lobe],
    viewpoints: Viewpoints,
    variant: str,
    plan: Plan,
    sampling: SamplingRecord,
    budget: BudgetRecord | None = None,
) -> Manifest:
    """Manifest of the bake before its first view: everything that fixes its bits."""
    packages = {name: version(name) for name in ("mitsuba", "drjit", "numpy", "OpenEXR")} | {"rsibr": rsibr.__version__}
    settings = config.model_dump(mode="json", exclude_none=True)
    return Manifest.planned(
        config=settings,
        identity={
            "config": {key: settings[key] for key in ("map", "sampling", "effects")},
            "environment": {"name": environment.name, "content": environment.digest},
            "material": {"name": material.name, "content": material.digest},
            "packages": {name: packages[name] for name in ("mitsuba", "drjit", "rsibr")},
            "variant": variant,
            "blocks": sampling.identity,
            "plan": {"grey": plan.grey, "light_samples": plan.light_samples, "left_out": list(plan.left_out)},
            "lobe_views": {lobe.name: lobe.own_views for lobe in plan.lobes if lobe.own_views is not None},
        },
        packages=packages,
        variant=variant,
        environment=EnvironmentRecord(name=environment.name, clipped=environment.clipped, lowest=environment.lowest),
        material=MaterialRecord(name=material.name, warp=material.warp, notes=_notes(material, plan)),
        lobes=tuple(_lobe_record(lobe, plan) for lobe in planned_lobes(kept_apart, plan)),
        resolution=config.map.resolution,
        directions=viewpoints.directions,
        triangles=viewpoints.triangles,
        plan=plan,
        sampling=sampling,
        budget=budget,
    )


def _lobe_record(lobe: Lobe, plan: Plan) -> LobeRecord:
    proxy = lobe.proxy
    terms = () if proxy is None else zip(proxy.alphas, proxy.coefficients, strict=True)
    return LobeRecord(
        name=lobe.name,
        alpha=lobe.alpha,
        albedo=_colours(lobe.albedo),
        proxies=tuple(ProxyRecord(alpha=alpha, coefficients=_colours(values)) for alpha, values in terms),
        views=next(planned.own_views for planned in plan.lobes if planned.name == lobe.name),
    )


def _colours(values: NDArray[np.float64]) -> tuple[tuple[float, float, float], ...]:
    return tuple((r, g, b) for r, g, b in values.round(6).tolist())


def _notes(material: Material, plan: Plan) -> tuple[str, ...]:
    """What of the material the warps do not follow; the bake says so, and so does every report on it."""
    found = {"retroreflection": RETROREFLECTIVE, "anisotropy": ANISOTROPIC}
    flagged = [note for name, note in found.items() if plan[name].missed]
    return tuple(dict.fromkeys([*material.notes, *flagged]))  # Mitsuba may have called it anisotropic already


def _bake_views(writer: BakeWriter, sampler: Sampler, on_progress: Callable[[Progress], None]) -> None:
    pending, views, record = writer.pending, len(sampler.frames), writer.manifest.sampling
    if not pending or record is None:
        return
    lobes = writer.manifest.lobes
    with ThreadPoolExecutor(1) as storing:  # the device need not wait until the last view is on the disk
        stored = storing.submit(lambda: None)
        for finished, index in enumerate(pending, start=views - len(pending)):
            start = time.perf_counter()

            def report(share: float, views_done: int = finished) -> None:
                on_progress(Progress(views_done, views, round(share * STEPS), STEPS))

            blocks, frame = sampler.blocks(record, index), sampler.frames[index]
            seed = sampler.config.seed
            baked = bake_view(sampler.integrator, frame, blocks, seed=seed, index=index, on_launch=report)
            seconds = max(0.0, time.perf_counter() - start)  # no clock that jumps may cost a view
            stored.result()  # a full disk ends the bake here
            stored = storing.submit(writer.commit, index, layered(baked, lobes, index), seconds)
        stored.result()
    on_progress(Progress(views, views, 0, STEPS))


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
        Frame of the map.
    blocks : Blocks
        Blocks of each texel, fixed before any of these samples is drawn; see `block_sizes`.
    seed, index : int
        Root of the seed tree, and the view's branch of it.
    on_launch : callable
        Called with the share of the work that is done.

    Returns
    -------
    MapFile
        Mean over the blocks, a layer a lobe, and the variance of their sum's mean.
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

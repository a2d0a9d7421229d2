"""Bakes a config: every view, in blocks of samples, into a directory that survives being killed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rsibr
from rsibr import backend
from rsibr.bake.integrator import SphereIntegrator
from rsibr.bake.manifest import EnvironmentRecord, LobeRecord, Manifest, MaterialRecord, ProxyRecord
from rsibr.bake.map_file import MapFile
from rsibr.bake.planning import (
    baked_costs,
    planned_lobes,
    planned_scene,
    planned_settings,
    planned_viewpoints,
    scope_of,
)
from rsibr.bake.store import Bake, BakeWriter, open_bake
from rsibr.effects.adaptation import adapted_lobes
from rsibr.effects.light import DELTA_RESOLUTION, RESOLUTION, light_map
from rsibr.effects.lobes import Lobe, LobeSplit
from rsibr.effects.plan import Plan
from rsibr.effects.plan_costs import priced
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.scene.config import Config, load_config
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.material import ANISOTROPIC, Material, load_material
from rsibr.scene.views import load_viewpoints

MAX_BLOCKS = 16
"""Independent blocks a view: their spread is the variance of the mean. Not more, for samples are stratified only within
a block and the blocks of a view are held in memory together."""

RETROREFLECTIVE = (
    "retroreflective: no warp follows light that goes back, so that expect larger errors between the views"
)

LEAST_BLOCK = 4
"""Samples a texel in a block below which there are rather fewer blocks."""


@dataclass(frozen=True)
class Progress:
    """How far a bake has come.

    Attributes
    ----------
    views_done, views : int
        Views finished, and in all.
    blocks_done, blocks : int
        Blocks of the view at work, finished and in all.
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
        Called after each block and each view.

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
    settings = config if isinstance(config, Config) else load_config(Path(config), overrides)
    backend.use()
    environment, material = load_environment(settings.environment), load_material(settings.material)
    plan, probed = planned_scene(settings, environment, material.bsdf(), block_sizes(settings.sampling.samples)[0])
    asked, settings = settings.map.resolution, planned_settings(settings, plan)
    all_around = load_viewpoints(settings.views)
    viewpoints = planned_viewpoints(all_around, settings, plan)
    split = None if settings.effects.lobes == "off" else probed
    lobes = adapted_lobes(split, environment, material, plan.rendering) if split else ()
    with backend.rendering(plan.rendering) as variant:
        manifest = plan_manifest(settings, environment, material, lobes, viewpoints, variant, plan)
    with BakeWriter.open(Path(out), manifest, fresh=fresh) as writer, backend.rendering(plan.rendering):
        if not writer.has_light:
            with backend.rendering("rgb" if environment.width else plan.rendering):  # an image is RGB from the start
                resolution = DELTA_RESOLUTION if any(lobe.is_mirror for lobe in lobes) else RESOLUTION
                writer.commit_light(light_map(environment.emitter(), environment.width, resolution))
        _bake_views(writer, settings, environment, material, split, viewpoints.directions, plan, on_progress)
        writer.record_plan(priced(plan, baked_costs(writer.manifest, len(all_around)), asked))
    return open_bake(Path(out))


def plan_manifest(
    config: Config,
    environment: Environment,
    material: Material,
    kept_apart: Sequence[Lobe],
    viewpoints: Viewpoints,
    variant: str,
    plan: Plan,
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
            "plan": {"grey": plan.grey, "light_samples": plan.light_samples, "left_out": list(plan.left_out)},
        },
        packages=packages,
        variant=variant,
        environment=EnvironmentRecord(name=environment.name, clipped=environment.clipped, lowest=environment.lowest),
        material=MaterialRecord(name=material.name, warp=material.warp, notes=_notes(material, plan)),
        lobes=tuple(_lobe_record(lobe) for lobe in planned_lobes(kept_apart, plan)),
        resolution=config.map.resolution,
        directions=viewpoints.directions,
        triangles=viewpoints.triangles,
        plan=plan,
    )


def _lobe_record(lobe: Lobe) -> LobeRecord:
    proxy = lobe.proxy
    terms = () if proxy is None else zip(proxy.alphas, proxy.coefficients, strict=True)
    return LobeRecord(
        name=lobe.name,
        alpha=lobe.alpha,
        albedo=_colours(lobe.albedo),
        proxies=tuple(ProxyRecord(alpha=alpha, coefficients=_colours(values)) for alpha, values in terms),
    )


def _colours(values: NDArray[np.float64]) -> tuple[tuple[float, float, float], ...]:
    return tuple((r, g, b) for r, g, b in values.round(6).tolist())


def _notes(material: Material, plan: Plan) -> tuple[str, ...]:
    """What of the material the warps do not follow; the bake says so, and so does every report on it."""
    found = {"retroreflection": RETROREFLECTIVE, "anisotropy": ANISOTROPIC}
    flagged = [note for name, note in found.items() if plan[name].missed]
    return tuple(dict.fromkeys([*material.notes, *flagged]))  # Mitsuba may have called it anisotropic already


def _bake_views(
    writer: BakeWriter,
    config: Config,
    environment: Environment,
    material: Material,
    split: LobeSplit | None,
    directions: NDArray[np.float64],
    plan: Plan,
    on_progress: Callable[[Progress], None],
) -> None:
    pending = writer.pending
    if not pending:
        return
    sampling = config.sampling
    integrator = SphereIntegrator(
        environment.emitter(), material.bsdf(), config.map.resolution, split, sampling.clamp, scope_of(plan)
    )
    blocks = block_sizes(sampling.samples)
    done = len(directions) - len(pending)
    for finished, index in enumerate(pending, start=done):
        start = time.perf_counter()

        def report(block: int, views_done: int = finished) -> None:
            on_progress(Progress(views_done, len(directions), block, len(blocks)))

        frame = view_frame(directions[index])
        baked = bake_view(integrator, frame, blocks, seed=sampling.seed, index=index, on_block=report)
        seconds = max(0.0, time.perf_counter() - start)  # no clock that jumps may cost a view
        writer.commit(index, baked, seconds)
    on_progress(Progress(len(directions), len(directions), 0, len(blocks)))


def bake_view(
    integrator: SphereIntegrator,
    frame: NDArray[np.float64],
    blocks: Sequence[int],
    *,
    seed: int,
    index: int,
    on_block: Callable[[int], None] = lambda _: None,
) -> MapFile:
    """Bake one view: a pure function of the scene, the view and the seed.

    Parameters
    ----------
    integrator : SphereIntegrator
        Scene and resolution.
    frame : ndarray, shape (3, 3)
        Frame of the map.
    blocks : sequence of int
        Samples a texel of each block, at least two blocks of equal size; see `block_sizes`.
    seed, index : int
        Root of the seed tree, and the view's branch of it.
    on_block : callable
        Called with the count of blocks done.

    Returns
    -------
    MapFile
        Mean over the blocks, a layer a lobe, and the variance of their sum's mean.
    """
    means = []
    for block, samples in enumerate(blocks):
        means.append(integrator.block(frame, samples, np.random.SeedSequence(seed, spawn_key=(index, block))))
        on_block(block + 1)
    lobes, _ = merge(means)
    _, variance = merge([block.sum(axis=1) for block in means])
    return MapFile(
        view=frame[:, 2].copy(),
        frame=frame,
        layers={name: integrator.image(lobes[:, k]) for k, name in enumerate(integrator.lobe_names)},
        variance=integrator.image(variance),
        coverage=integrator.coverage,
        grey=integrator.grey,
    )


def merge(means: Iterable[NDArray[np.float32]]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean of equally large independent blocks, and the variance of that mean.

    Parameters
    ----------
    means : iterable of ndarray, shape (T, …)
        Block means in the order of the blocks, whatever order they were rendered in.

    Returns
    -------
    mean, variance : ndarray, shape (T, …), float32
        The variance estimate has (blocks − 1) degrees of freedom.
    """
    stacked = np.stack(list(means)).astype(np.float64)
    variance = stacked.var(axis=0, ddof=1) / len(stacked)
    return stacked.mean(axis=0).astype(np.float32), variance.astype(np.float32)


def block_sizes(samples: int) -> list[int]:
    """Split the samples of a texel into independent blocks of equal size.

    Parameters
    ----------
    samples : int
        Samples a texel, at least 2. Rounded up to a multiple of the count of blocks.
    """
    count = max(2, min(MAX_BLOCKS, samples // LEAST_BLOCK))
    return [-(-samples // count)] * count

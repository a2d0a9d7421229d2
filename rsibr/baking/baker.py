"""Bake of a config: all views, in blocks of samples, into a directory from which a killed bake resumes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from rsibr import backend, clock
from rsibr.baking.finished import finished_bake
from rsibr.baking.job import disk_and_memory, with_time
from rsibr.baking.sampling import Steering
from rsibr.baking.scene import Scene
from rsibr.baking.units import Work, record_end, require_sound
from rsibr.baking.view import bake_views
from rsibr.job_size import JobSize
from rsibr.progress import Progress
from rsibr.scene.config import ConfigLike, config_of
from rsibr.store.bake import Bake, open_bake
from rsibr.store.manifest import BudgetRecord


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
    lights: Path | str | None = None,
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
    lights : path, optional
        Folder `lights` beside the bake or above it, in which bakes under one sky share the file of their environment.
        By default each bake holds its own.

    Returns
    -------
    Bake
        Finished bake, opened and verified.

    Raises
    ------
    InputError
        If the config, the environment, the material, the views or `lights` are invalid, or the bake exceeds the free
        disk space or memory, unless `allow_large`.
    BakeError
        If `out` holds other files, a bake of another config, or one that another process is writing.
    MachineError
        If the machine has no usable backend, or the disk is full.
    CheckFailed
        If the maps are finished and of no use: largely not finite, or black although there is light and the material
        reflects. They are kept.
    """
    on_progress, on_forecast = backend.unlocked(on_progress), backend.unlocked(on_forecast)
    shared = None if lights is None else Path(lights)
    with clock.counting() as begun:
        prepared = config if isinstance(config, Scene) else None
        settings = config.config if isinstance(config, Scene) else config_of(config, overrides)
        if settings.budget is not None:
            raise ValueError("a budget must be resolved before the bake")
        if not fresh and (found := finished_bake(settings, out, prepared.digests if prepared else None)) is not None:
            return found
        work = Work.of(prepared or Scene.prepare(settings), steering)
        job = disk_and_memory(work.scene, Path(out))
        job.admit(out, allow_large)
        with work.begin(Path(out), begun, fresh=fresh, budget=budget, lights=shared) as writer:
            is_finished = writer.has_light and not writer.pending  # only what the manifest records has changed
            if writer.pending and writer.manifest.sampling is not None:
                on_forecast(with_time(job, work.scene, writer.manifest.sampling, len(writer.pending)))
            bake_views(work.sampler, writer.manifest, writer.pending, writer.commit, on_progress)
            record_end(writer, work.scene.config, time.perf_counter() if is_finished else begun)
        return require_sound(open_bake(Path(out)), lambda: work.scene)

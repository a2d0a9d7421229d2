"""Bake and plan of any config; with a budget for the whole bake, its open parameters are chosen first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rsibr import backend, clock
from rsibr.baking.baker import bake as run_bake
from rsibr.baking.finished import finished_bake
from rsibr.baking.forecast import forecast
from rsibr.baking.scene import Scene
from rsibr.budget.choose import choose
from rsibr.budget.reached import reached_error
from rsibr.errors import BakeError
from rsibr.job_size import JobSize
from rsibr.methods.registry import require_method_options
from rsibr.planning.plan import Plan
from rsibr.progress import BAKE, Progress
from rsibr.scene.config import Config, ConfigLike, config_of, parse_config
from rsibr.shown_progress import shows_progress
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.difference import changes
from rsibr.store.directory import claim_directory
from rsibr.store.manifest import MANIFEST_NAME, BudgetRecord, Manifest, SamplingRecord, read_manifest

_ANEW = "use --fresh to bake anew, or another --out"

_BY_CONTENT = ("environment", "material", "plugins")
"""Tables of a config that are compared by the digest of what they name, not by the names of files."""


@shows_progress(BAKE)
@backend.in_session
def bake(
    config: ConfigLike,
    *,
    out: Path | str,
    overrides: Sequence[str] = (),
    fresh: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
    lights: Path | str | None = None,
) -> Bake:
    """Bake the radiance sphere maps of all views, within the config's budget if it has one.

    A killed bake resumes, and its result is bit-identical to that of an uninterrupted one: the choices of a budget are
    recorded before the first view and not made again. A complete bake is opened and returned.

    Parameters
    ----------
    config, out, overrides, fresh, on_progress, on_forecast, allow_large, lights
        See `rsibr.baking.baker.bake`.

    Returns
    -------
    Bake
        Finished bake, opened and verified. `bake.manifest.budget` and `bake.manifest.sampling` record what was
        promised, chosen and reached.

    Raises
    ------
    InputError
        If the config, the environment, the material or the views are invalid, a budget cannot be met, or the bake
        exceeds the free disk space or memory, unless `allow_large`.
    BakeError
        If `out` holds other files, a bake of another config, or one that another process is writing.
    MachineError
        If the machine has no usable backend, or the disk is full.
    CheckFailed
        If the maps are finished and of no use: largely not finite, or black although there is light and the material
        reflects. They are kept.

    Examples
    --------
    >>> bake = rsibr.bake("configs/demo.toml", out="out/paint.rsibr")                      # doctest: +SKIP
    >>> bake = rsibr.bake("configs/demo.toml", out="out/small.rsibr", overrides=["map.resolution=64"])  # doctest: +SKIP
    """
    path = Path(out)
    run = partial(
        run_bake,
        out=path,
        fresh=fresh,
        on_progress=on_progress,
        on_forecast=on_forecast,
        allow_large=allow_large,
        lights=lights,
    )
    with clock.counting() as begun:
        settings = config_of(config, overrides)
        require_method_options(settings)
        if settings.budget is None:
            return run(settings)
        if not fresh and (found := finished_bake(settings, path)) is not None:
            return found
        claim_directory(path)
        recorded = None if fresh else _recorded(path, settings)
        scene = Scene.prepare(settings)
        sized, record = recorded or choose(scene, begun)
        baked = run(scene.resized(sized), budget=record)
    if baked.manifest.budget and baked.manifest.budget.reached_seconds is None:
        _record_reached(baked, scene)
    return open_bake(path)


@backend.in_session
def plan(config: ConfigLike, *, overrides: Sequence[str] = ()) -> Plan:
    """Plan a bake, with the resolution, views and samples that its budget chooses; see `rsibr.baking.forecast.plan`.

    Examples
    --------
    >>> plan = rsibr.plan("configs/demo.toml")                                             # doctest: +SKIP
    >>> [effect.name for effect in plan.effects if effect.on]                              # doctest: +SKIP
    """
    return planned(config, overrides)[0]


def planned(
    config: ConfigLike, overrides: Sequence[str] = ()
) -> tuple[Plan, SamplingRecord | None, BudgetRecord | None]:
    """Plan, with the choices of a target error, a time budget, or a budget for the whole bake. Nothing is baked."""
    with clock.counting() as begun:
        settings = config_of(config, overrides)
        require_method_options(settings)
        scene = Scene.prepare(settings)
        if scene.config.budget is None:
            return (*forecast(scene, begun), None)
        sized, record = choose(scene, begun)
        return (*forecast(scene.resized(sized), begun), record)


def _recorded(path: Path, config: Config) -> tuple[Config, BudgetRecord] | None:
    """Config and budget record of the bake in `path`; None if there is no bake.

    Files that the config names may have moved: what is in them is compared when the bake is resumed.
    """
    if not (path / MANIFEST_NAME).exists():
        return None
    found, wanted = read_manifest(path / MANIFEST_NAME).budget, config.to_dict()
    if found is None:
        raise BakeError("holds a bake without a budget", where=str(path), fix=_ANEW)
    if changed := changes(_without_content(found.asked), _without_content(wanted)):
        raise BakeError(f"holds a bake of another config ({'; '.join(changed)})", where=str(path), fix=_ANEW)
    contents = {name: wanted[name] for name in _BY_CONTENT if name in wanted}
    resolved = parse_config({**found.resolved, **contents}, path, where=str(path / MANIFEST_NAME))
    if config.views.file is not None:
        resolved = resolved.model_copy(update={"views": config.views})
    return resolved, found.model_copy(update={"asked": wanted})


def _without_content(asked: Mapping[str, Any]) -> dict[str, Any]:
    """Part of a config that is compared by its values."""
    plain = {name: table for name, table in asked.items() if name not in _BY_CONTENT}
    return {**plain, "views": {**asked.get("views", {}), "file": "file" in asked.get("views", {})}}


def _record_reached(baked: Bake, scene: Scene) -> None:
    """Measure the error of a finished bake, and record error and time in its manifest."""
    found = reached_error(baked, scene)

    def told(manifest: Manifest | None) -> Manifest:
        if manifest is None or manifest.budget is None:
            raise ValueError("the bake has no budget")
        seconds = manifest.whole_seconds  # includes the choice
        reached = {"reached_error": found.value, "reached_ci95": found.ci95, "reached_seconds": seconds}
        return manifest.model_copy(update={"budget": manifest.budget.model_copy(update=reached)})

    with BakeWriter.open(baked.path, told):
        pass  # opening writes the manifest

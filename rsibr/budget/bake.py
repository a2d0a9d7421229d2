"""Bakes and plans of any config: where it has a budget of the whole bake, what that leaves open is chosen first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from rsibr import backend, clock
from rsibr.baking.baker import bake as run_bake
from rsibr.baking.finished import finished_bake
from rsibr.baking.forecast import forecast
from rsibr.baking.scene import Scene
from rsibr.budget.choose import choose
from rsibr.budget.reached import reached_error
from rsibr.errors import BakeError
from rsibr.planning.plan import Plan
from rsibr.progress import Progress
from rsibr.scene.config import Config, ConfigLike, config_of
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.directory import claim_directory
from rsibr.store.manifest import MANIFEST_NAME, BudgetRecord, Manifest, SamplingRecord, read_manifest


@backend.in_session
def bake(
    config: ConfigLike,
    *,
    out: Path | str,
    overrides: Sequence[str] = (),
    fresh: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Bake:
    """Bake the radiance sphere maps of all views, within the config's budget where it has one.

    A bake that was killed goes on where it was and ends bit-identical to one that never was: what a budget decided is
    recorded before the first view and not decided again. One that is complete is opened, and nothing else is done.

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
    path = Path(out)
    with clock.counting() as begun:
        settings = config_of(config, overrides)
        if settings.budget is None:
            return run_bake(settings, out=path, fresh=fresh, on_progress=on_progress)
        if not fresh and (found := finished_bake(settings, path)) is not None:
            return found
        claim_directory(path)
        recorded = None if fresh else _recorded(path, settings)
        scene = Scene.prepare(settings)
        sized, record = recorded or choose(scene, begun)
        baked = run_bake(scene.resized(sized), out=path, fresh=fresh, on_progress=on_progress, budget=record)
    if baked.manifest.budget and baked.manifest.budget.reached_seconds is None:
        _record_reached(baked, scene)
    return open_bake(path)


@backend.in_session
def plan(config: ConfigLike, *, overrides: Sequence[str] = ()) -> Plan:
    """Say what a bake would simulate, of the size that its budget would choose; see `rsibr.baking.forecast.plan`."""
    return planned(config, overrides)[0]


def planned(
    config: ConfigLike, overrides: Sequence[str] = ()
) -> tuple[Plan, SamplingRecord | None, BudgetRecord | None]:
    """Plan, and what a target, a time or a budget would choose. Nothing is baked."""
    with clock.counting() as begun:
        scene = Scene.prepare(config, overrides)
        if scene.config.budget is None:
            return (*forecast(scene, begun), None)
        sized, record = choose(scene, begun)
        return (*forecast(scene.resized(sized), begun), record)


def _recorded(path: Path, config: Config) -> tuple[Config, BudgetRecord] | None:
    """What was chosen for the bake that is there."""
    if not (path / MANIFEST_NAME).exists():
        return None
    found = read_manifest(path / MANIFEST_NAME)
    if found.budget is None or found.budget.asked != config.to_dict():
        what = "holds a bake of another config or budget"
        raise BakeError(what, where=str(path), fix="use --fresh to bake anew, or another --out")
    return Config.model_validate(found.budget.resolved), found.budget


def _record_reached(baked: Bake, scene: Scene) -> None:
    """Measure the error of a finished bake, and keep it with the time it took."""
    found = reached_error(baked, scene)

    def told(manifest: Manifest | None) -> Manifest:
        if manifest is None or manifest.budget is None:
            raise ValueError("the bake has no budget")
        seconds = manifest.whole_seconds  # the choice is part of it
        reached = {"reached_error": found.value, "reached_ci95": found.ci95, "reached_seconds": seconds}
        return manifest.model_copy(update={"budget": manifest.budget.model_copy(update=reached)})

    with BakeWriter.open(baked.path, told):
        pass  # what is told is on the disk

"""Units of work of a bake: its views in chunks, in any process, in any order, killed or repeated, to the same bits.

`prepare` decides what is baked and writes that down; `bake_unit` bakes some views, and needs nothing but the directory;
`finish` takes over what units have stored. `rsibr.baking.baker.bake` is all three in one process::

    prepared = prepare("paint.toml", "paint.rsibr")
    for chunk in chunks(prepared.pending):          # anywhere, at the same time
        bake_unit(prepared.path, chunk)
    bake = finish(prepared.path)
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from rsibr import backend, clock
from rsibr.baking.baked_costs import baked_costs
from rsibr.baking.finished import finished_bake
from rsibr.baking.job import disk_and_memory, with_time
from rsibr.baking.planned_manifest import plan_manifest
from rsibr.baking.sampling import Sampler, Steering
from rsibr.baking.scene import Scene
from rsibr.baking.view import bake_views
from rsibr.errors import BakeError, CheckFailed
from rsibr.job_size import JobSize
from rsibr.planning.costs import priced
from rsibr.progress import Progress
from rsibr.scene.config import Config, ConfigLike, config_of, parse_config
from rsibr.scene.views import load_viewpoints
from rsibr.store.bake import Bake, open_bake, unfinished
from rsibr.store.difference import bits_digest, differences
from rsibr.store.directory import BAKE_AGAIN
from rsibr.store.integrity import is_sound_map
from rsibr.store.manifest import MANIFEST_NAME, BudgetRecord, Manifest, read_manifest
from rsibr.store.map_file import MapFile
from rsibr.store.sidecar import adopted, store_view
from rsibr.store.soundness import fault_of
from rsibr.store.writer import BakeWriter

REFLECTS = 1e-6
"""Albedo above which black maps are a fault under a light that shines."""

_latest: dict[str, Work] = {}
"""Prepared scene of the last unit of this process, by its `bits_digest`: chunks of one bake follow each other."""


@dataclass(frozen=True)
class Prepared:
    """A bake whose samples are chosen, and whose environment is stored.

    Attributes
    ----------
    path : Path
        Directory of the bake.
    manifest : Manifest
        Its manifest.
    """

    path: Path
    manifest: Manifest

    @property
    def pending(self) -> tuple[int, ...]:
        """Views that no one has baked yet, ascending; none if the bake is complete."""
        return tuple(self.manifest.pending)


@dataclass(frozen=True, eq=False)
class Work:
    """Scene of a bake with its samples: what bakes views."""

    scene: Scene
    steering: Steering

    @classmethod
    def of(cls, scene: Scene, steering: Steering | None = None) -> Work:
        """Make the work of a scene."""
        return cls(scene, steering or Steering())

    @cached_property
    def sampler(self) -> Sampler:
        """Samples of each view."""
        return Sampler(self.scene.integrator, self.scene.frames, self.scene.config.sampling, self.steering)

    @contextmanager
    def begin(
        self, out: Path, begun: float, *, fresh: bool, budget: BudgetRecord | None, lights: Path | None
    ) -> Iterator[BakeWriter]:
        """Open the writer of the bake in the variant of its maps, with its samples chosen and its light stored."""
        scene = self.scene
        sampler = self.sampler
        if scene.config.sampling.time_budget_s is not None:
            _ = scene.light  # made before the samples are chosen, so that its time counts toward the budget
        with backend.rendering(scene.rendering):

            def manifest(found: Manifest | None) -> Manifest:
                _ = scene.stored_lobes  # made now, so that their time counts as set-up, before the first view
                sampling = (found.sampling if found else None) or sampler.choose(begun)
                return plan_manifest(scene, scene.viewpoints, sampling, budget)

            with BakeWriter.open(out, manifest, fresh=fresh) as writer:
                if not writer.has_light:
                    writer.commit_light(scene.light if lights is None else scene.shared_light, lights)
                yield writer


@backend.in_session
def prepare(
    config: ConfigLike | Scene,
    out: Path | str,
    *,
    overrides: Sequence[str] = (),
    fresh: bool = False,
    budget: BudgetRecord | None = None,
    steering: Steering | None = None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
    lights: Path | str | None = None,
) -> Prepared:
    """Decide what a bake renders, and write its manifest and its environment; no view is baked.

    Views that a killed bake has left are kept, as those of units that run meanwhile.

    Parameters
    ----------
    config, out, overrides, fresh, budget, steering, on_forecast, allow_large, lights
        See `rsibr.baking.baker.bake`.

    Returns
    -------
    Prepared
        Directory and pending views.

    Raises
    ------
    InputError, BakeError, MachineError
        As `rsibr.baking.baker.bake`.
    """
    with clock.counting() as begun:
        prepared = config if isinstance(config, Scene) else None
        settings = config.config if isinstance(config, Scene) else config_of(config, overrides)
        if settings.budget is not None:
            raise ValueError("a budget must be resolved before the bake")
        if not fresh and (found := finished_bake(settings, out, prepared.digests if prepared else None)) is not None:
            return Prepared(found.path, found.manifest)
        work = Work.of(prepared or Scene.prepare(settings), steering)
        job = disk_and_memory(work.scene, Path(out))
        job.admit(out, allow_large)
        shared = None if lights is None else Path(lights)
        with work.begin(Path(out), begun, fresh=fresh, budget=budget, lights=shared) as writer:
            if writer.pending and writer.manifest.sampling is not None:
                backend.unlocked(on_forecast)(with_time(job, work.scene, writer.manifest.sampling, len(writer.pending)))
            _remember(work, bits_digest(writer.manifest))
        return Prepared(Path(out), writer.manifest)


@backend.in_session
def bake_unit(
    out: Path | str, views: Sequence[int], *, on_progress: Callable[[Progress], None] = lambda _: None
) -> None:
    """Bake some views of a prepared bake; in any process, at any time, as often as one likes.

    Each view is stored as its map and then its sidecar, whole or not at all. Nothing else in the directory is written,
    and no lock is needed. Views that are whole already are skipped.

    Parameters
    ----------
    out : path
        Directory of the bake, from `prepare`.
    views : sequence of int
        Indices of the views.
    on_progress : callable
        Called after each launch and each view; never if there is nothing to bake.

    Raises
    ------
    BakeError
        If there is no prepared bake, or its maps would get other bits here: the code of rsibr, a package, the
        processor, or the content of a file of the config is another one than where it was prepared.
    IndexError
        If a view does not exist.
    MachineError
        If the disk is full. Views stored before that stay.
    """
    path, on_progress = Path(out), backend.unlocked(on_progress)
    manifest = read_manifest(path / MANIFEST_NAME)
    if not all(0 <= index < len(manifest.views) for index in views):
        raise IndexError(f"a view of {list(views)} is none of the {len(manifest.views)}")
    bits = bits_digest(manifest)
    pending = [index for index in dict.fromkeys(views) if not _is_stored(path, manifest, bits, index)]
    if not pending:
        return
    work = _latest.get(bits) or _remember(_work_of(path, manifest), bits)

    def store(index: int, baked: MapFile, seconds: float) -> None:
        store_view(path, manifest, bits, index, baked, seconds)

    with backend.rendering(work.scene.rendering):
        bake_views(work.sampler, manifest, pending, store, on_progress)


@backend.in_session
def finish(out: Path | str) -> Bake:
    """Take over the views that units have stored, write the final manifest, and open the bake.

    Parameters
    ----------
    out : path
        Directory of the bake, from `prepare`.

    Returns
    -------
    Bake
        Finished bake, opened and verified.

    Raises
    ------
    BakeError
        If there is no prepared bake, views are missing, or another process is writing its manifest.
    CheckFailed
        If the maps are of no use; see `rsibr.baking.baker.bake`.
    """
    path, begun = Path(out), time.perf_counter()
    config = _config_of(read_manifest(path / MANIFEST_NAME), path)
    with BakeWriter.open(path, _as_planned) as writer:
        if not writer.has_light:
            raise BakeError("has lost its light", where=str(path), fix=BAKE_AGAIN)
        if writer.pending:
            raise unfinished(path, writer.manifest)
        if writer.manifest.plan is None or writer.manifest.plan.seconds is None:
            record_end(writer, config, begun)
    return require_sound(open_bake(path), lambda: Scene.prepare(config))


def record_end(writer: BakeWriter, config: Config, begun: float) -> None:
    """Record the costs of a bake whose views are all done; `begun` as `time.perf_counter` told it."""
    seconds = max(0.0, time.perf_counter() - begun)  # never negative, even if the clock jumps
    manifest = writer.manifest
    if manifest.plan is not None:
        costs = baked_costs(manifest, len(load_viewpoints(config.views)), manifest.wall_seconds + seconds)
        writer.record_end(priced(manifest.plan, costs, config.map.side), seconds)


def require_sound(baked: Bake, scene: Callable[[], Scene]) -> Bake:
    """Return a finished bake; raise if its maps as a whole are unusable. Its files stay, so that they can be seen."""

    def should_shine() -> bool:
        lobes = scene().parts.probes.material.lobes
        kept = [lobe for lobe in lobes if lobe.name not in scene().plan.left_out]
        return not baked.light.is_black and any(lobe.albedo.max() > REFLECTS for lobe in kept)

    fault = fault_of(baked.manifest, should_shine)
    if not fault:
        return baked
    told = baked.manifest
    raise CheckFailed(
        f"baked, and of no use: {fault}",
        where=str(baked.path),
        fix=f"check how {told.material.name} evaluates and samples ({told.environment.name} is the light); "
        f"the maps are kept, and `rsibr check {baked.path}` shows where",
    )


def _as_planned(found: Manifest | None) -> Manifest:
    if found is None:
        raise ValueError("the bake was not prepared")
    return found


def _is_stored(path: Path, manifest: Manifest, bits: str, index: int) -> bool:
    if manifest.views[index].done:
        return is_sound_map(path, manifest, index)
    return adopted(path, manifest, bits, index) is not None


def _remember(work: Work, bits: str) -> Work:
    _latest.clear()
    _latest[bits] = work
    return work


def _work_of(path: Path, manifest: Manifest) -> Work:
    """Prepare the scene of a bake again, and check that it is the one that the manifest describes."""
    if manifest.sampling is None:
        raise BakeError("was not prepared: its samples are not chosen", where=str(path), fix=BAKE_AGAIN)
    work = Work.of(Scene.prepare(_config_of(manifest, path)))
    with backend.rendering(work.scene.rendering):
        wanted = plan_manifest(work.scene, work.scene.viewpoints, manifest.sampling, manifest.budget)
    if differing := differences(manifest, wanted):
        what = f"cannot be continued here, where maps would get other bits ({'; '.join(differing)})"
        fix = "bake all its views with one version of rsibr, on processors of one kind, from the same files"
        raise BakeError(what, where=str(path), fix=fix)
    return work


def _config_of(manifest: Manifest, path: Path) -> Config:
    """Config by which the maps are rendered: that of the bake, or the one that its budget chose."""
    tables = manifest.config if manifest.budget is None else manifest.budget.resolved
    return parse_config(tables, path, where=str(path / MANIFEST_NAME))

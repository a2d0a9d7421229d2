"""Runs a comparison: measures what is missing, sums up by class of material, writes the report."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from rsibr import backend, clock
from rsibr.baking.job import LIGHT_BYTES, NOISY_SHARE
from rsibr.errors import InputError
from rsibr.job_size import JobSize
from rsibr.progress import Job, Progress
from rsibr.shown_progress import shows_progress
from rsibr.store.map_file import map_channels
from rsibr.store.tabular import Tabular
from rsibr.studies.agenda import agenda_of
from rsibr.studies.bench import Bench
from rsibr.studies.compare.budgets import classes_of
from rsibr.studies.compare.config import CompareConfig, load_compare, parse_compare
from rsibr.studies.compare.document import CompareDocument
from rsibr.studies.compare.external import External, ExternalMap, common_frames, maps_of_scenes, parse_externals
from rsibr.studies.compare.measure import SHOWN, Measured, SceneBench
from rsibr.studies.compare.pictures import ScenePictures, draw_scene
from rsibr.studies.compare.records import ComparedScene, SystemRecord
from rsibr.studies.compare.report import FILES, compare_table, write_comparison
from rsibr.studies.compare.systems import settings_of, systems_of
from rsibr.studies.feasible import check_folders, check_sizes
from rsibr.studies.job import MOST_LOBES, PREPARED_BYTES
from rsibr.studies.journal import Journal, lock_study
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.rates import view_count
from rsibr.studies.runner import BAKES_NAME, JOURNAL_NAME, REFERENCES_NAME, machine_record
from rsibr.studies.scene import StudyScene, judged_views, load_scenes
from rsibr.studies.truth import TruthStore


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabular):
    """A finished comparison.

    Attributes
    ----------
    document : CompareDocument
        All of it, as `compare.json` holds it.
    out : Path
        Its directory: `compare.html`, `compare.json`, `compare.csv`, `pictures/`, the bakes and the references.
    """

    document: CompareDocument
    out: Path

    def __repr__(self) -> str:
        return f"Comparison({len(self.document.systems)} systems, {len(self.document.scenes)} scenes)"

    def csv(self) -> str:
        """Text of `compare.csv`: a row a point."""
        return compare_table(self.document)


Source = CompareConfig | Mapping[str, Any] | Path | str


@shows_progress(Job("compare"))
@backend.in_session
def compare(
    configs: Sequence[Source],
    *,
    out: Path | str,
    methods: Sequence[str] | None = None,
    external: Sequence[str] = (),
    views: int | None = None,
    samples: int | None = None,
    on_progress: Callable[[Progress], None] = lambda _: None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
) -> Comparison:
    """Compare systems on the same scenes: error against time and memory.

    A comparison that was killed goes on where it was.

    Parameters
    ----------
    configs : sequence of CompareConfig, mapping or path
        Bake configs (TOML), one scene each, or comparison files; see `rsibr.studies.compare.config`.
    out : path
        Directory of the comparison, made if need be.
    methods : sequence of str, optional
        Names of methods; by default those of the config, or all.
    external : sequence of str
        `NAME=PLACE`: maps of another program; see `rsibr.studies.compare.external`. All systems are then judged at the
        views of these maps.
    views : int, optional
        Novel views; by default those of the config.
    samples : int, optional
        Samples a texel of each reference; by default those of the config.
    on_progress : callable
        Called before each measurement with the number done and the total, and at the end.
    on_forecast : callable
        Called once with bytes and memory of what is left to do.
    allow_large : bool
        Start even if the comparison exceeds the free disk space or memory.

    Returns
    -------
    Comparison
        Also written to `out`.

    Raises
    ------
    InputError
        If a config, a method or an external map is wrong, or it exceeds the free disk space or memory.
    BakeError
        If another process writes into `out`, or it may not be written to.
    CheckFailed
        If a method makes NaN.
    """
    on_progress, on_forecast = backend.unlocked(on_progress), backend.unlocked(on_forecast)
    with clock.counting() as begun:
        settings = [_settings(config).judged_with(views=views, samples=samples) for config in configs]
        if not settings:
            raise InputError("no config given", where="configs", fix="name at least one")
        names = [settings_of(config, methods) for config in settings]
        others = parse_externals(external)
        if views is not None and others:
            what = "the views are those of the external maps"
            raise InputError(what, where="views", fix="leave it out, or leave out --external")
        backend.use()
        folder = Path(out)
        with lock_study(folder):
            check_folders(folder, (BAKES_NAME, REFERENCES_NAME, JOURNAL_NAME), FILES)
            benches = _benches(settings, names, others, folder)
            job = _job(benches)
            job.admit(folder, allow_large)
            on_forecast(job)
            systems = [*systems_of([name for group in names for name in group]), *(one.name for one in others)]
            return _Run(benches, systems, folder, begun, settings).done(on_progress)


@dataclass(eq=False)
class _Run:
    """One run of a comparison, from its first measurement to its page."""

    benches: Sequence[SceneBench]
    names: list[str]
    folder: Path
    begun: float
    settings: Sequence[CompareConfig]

    def done(self, on_progress: Callable[[Progress], None]) -> Comparison:
        """Make the remaining measurements and write the report."""
        total, done, scenes = sum(bench.steps for bench in self.benches), 0, []
        for bench in self.benches:
            found: list[tuple[str, Measured]] = []
            for name, measure in _measurements(bench):
                on_progress(Progress(done, total, f"{bench.bench.scene.name}: {name}"))
                done += 1
                if measure is not None:
                    found.append((name, measure()))
            scenes.append(_scene(bench, found))
            bench.close()
        on_progress(Progress(total, total, "page"))
        return self._written([scene for scene, _ in scenes], [pictures for _, pictures in scenes])

    def _written(self, scenes: list[ComparedScene], pictures: list[ScenePictures]) -> Comparison:
        scenes = _compiled(scenes)
        document = CompareDocument(
            schema=1,
            name=", ".join(one.study.name for one in self.settings),
            machine=machine_record(backend.use()),
            reference_samples=min(one.study.judge.samples for one in self.settings),
            shown_view=SHOWN,
            seconds=time.perf_counter() - self.begun,
            systems=self.names,
            classes=classes_of(scenes),
            scenes=scenes,
        )
        write_comparison(document, pictures, self.folder)
        return Comparison(document, self.folder)


def _settings(config: Source) -> CompareConfig:
    if isinstance(config, CompareConfig):
        return config
    return parse_compare(config) if isinstance(config, Mapping) else load_compare(Path(config))


def _benches(
    settings: Sequence[CompareConfig], names: Sequence[list[str]], others: Sequence[External], folder: Path
) -> list[SceneBench]:
    """Measurements of every scene of every config, with unique names of scenes."""
    journal, compiled = Journal(folder / JOURNAL_NAME), dict[str, float]()
    store = TruthStore(folder / REFERENCES_NAME, journal)
    loaded = [
        (config, methods, scene)
        for config, methods in zip(settings, names, strict=True)
        for scene in _loaded(config, folder)
    ]
    scenes = _with_unique_names([scene for _, _, scene in loaded])
    maps = _external_maps(others, scenes)
    found = []
    for (config, methods, _), scene in zip(loaded, scenes, strict=True):
        theirs = {name: by_scene[scene_folder(scene)] for name, by_scene in maps.items()}
        frames = common_frames(theirs) if theirs else judged_views(config.study)
        judged = JudgedScene(scene, frames, config.study.judge, store)
        bench = Bench(judged, journal, folder / BAKES_NAME, compiled)
        found.append(SceneBench(bench, list(agenda_of(config.study)), methods, theirs))
    return found


def _loaded(config: CompareConfig, folder: Path) -> list[StudyScene]:
    """Scenes of a config."""
    agenda = agenda_of(config.study)
    resolution = config.study.judge.resolution or max(size.resolution for size in agenda)
    check_sizes(config.study, agenda, resolution, folder)
    return load_scenes(config.study, resolution)


def _with_unique_names(scenes: Sequence[StudyScene]) -> list[StudyScene]:
    """Number the materials of scenes that would have the name of another: configs may share a material and a sky."""
    taken, found = set[str](), []
    for scene in scenes:
        named, number = scene, 1
        while scene_folder(named) in taken:
            number += 1
            named = replace(scene, material_name=f"{scene.material_name} {number}")
        taken.add(scene_folder(named))
        found.append(named)
    return found


def scene_folder(scene: StudyScene) -> str:
    """Name of the folder of a scene among external maps, and of its pictures."""
    return re.sub(r"[^\w.]+", "-", f"{scene.material_name} {scene.environment_name}").strip("-.")


def _external_maps(others: Sequence[External], scenes: Sequence[StudyScene]) -> dict[str, dict[str, list[ExternalMap]]]:
    sides = {scene_folder(scene): scene.resolution for scene in scenes}
    return {one.name: maps_of_scenes(one, sides) for one in others}


def _job(benches: Sequence[SceneBench]) -> JobSize:
    """Bytes of the missing bakes, with as many lobes as a material may have, and memory of the largest."""
    missing = [(bench.bench, size) for bench in benches for size in bench.sizes if bench.is_missing(size)]
    texels = [view_count(bench.scene, size) * size.resolution**2 for bench, size in missing]
    sizes = [LIGHT_BYTES + NOISY_SHARE * 4 * count * map_channels(MOST_LOBES) for count in texels]
    keeps = all(bench.bench.judged.judge.keep_bakes for bench in benches)
    disk = sum(sizes) if keeps else max(sizes, default=0)
    name = f"comparison on {len(benches)} scene{'s' * (len(benches) != 1)}"
    return JobSize(name, disk=round(disk), memory=PREPARED_BYTES * max(texels, default=0))


def _measurements(bench: SceneBench) -> Iterator[tuple[str, Callable[[], Measured] | None]]:
    """Name and function of each measurement; None for one that is not asked for."""
    for size in bench.sizes:
        for name in bench.settings:
            yield name, partial(bench.measure, size, name) if bench.is_asked(size, name) else None
    for name in bench.external:
        yield name, partial(bench.judge, name)


def _scene(bench: SceneBench, found: Sequence[tuple[str, Measured]]) -> tuple[ComparedScene, ScenePictures]:
    judged, scene = bench.bench.judged, bench.bench.scene
    by_label = {one.record.label: one for _, one in found if one.record is not None}
    record = ComparedScene(
        material=scene.material_name,
        material_class=scene.material_class,
        environment=scene.environment_name,
        folder=scene_folder(scene),
        resolution=scene.resolution,
        views=[(float(x), float(y), float(z)) for x, y, z in (frame[:, 2] for frame in judged.frames)],
        reference=judged.record(),
        systems=[one.record for one in by_label.values() if one.record is not None],
        refused={name: one.refusal for name, one in found if one.record is None},
    )
    return record, draw_scene(record, judged.references, by_label)


def _compiled(scenes: Sequence[ComparedScene]) -> list[ComparedScene]:
    """Charge each setting with its longest compilation: a process compiles a kernel once."""
    longest = dict[str, float]()
    for one in (record for scene in scenes for record in scene.systems):
        if one.cost is not None:
            longest[one.label] = max(one.cost.compile_seconds, longest.get(one.label, 0.0))

    def charged(record: SystemRecord) -> SystemRecord:
        if record.cost is None:
            return record
        cost = record.cost.model_copy(update={"compile_seconds": longest[record.label]})
        return record.model_copy(update={"cost": cost})

    return [scene.model_copy(update={"systems": [charged(one) for one in scene.systems]}) for scene in scenes]

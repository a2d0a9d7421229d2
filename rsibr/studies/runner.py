"""Runs a study: everything that it asks for and that is not there yet, then what all of it says together."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rsibr import backend
from rsibr.progress import Progress
from rsibr.studies.agenda import Agenda, agenda_of
from rsibr.studies.analysis import SceneAnalysis, analyse
from rsibr.studies.bench import Bench
from rsibr.studies.config import StudyConfig, load_study, parse_study
from rsibr.studies.document import JudgeRecord, MachineRecord, StudyDocument
from rsibr.studies.doubling import doubling_of
from rsibr.studies.forecast import Rates, Step, steps_of
from rsibr.studies.journal import Journal, lock_study
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.report import write_study
from rsibr.studies.results import PointRecord, SceneRecord
from rsibr.studies.scene import judged_views, load_scenes
from rsibr.studies.truth import TruthStore
from rsibr.version import __version__

BAKES_NAME, REFERENCES_NAME, JOURNAL_NAME = "bakes", "references", "journal"


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """A finished study.

    Attributes
    ----------
    document : StudyDocument
        All of it, as `study.json` holds it.
    out : Path
        Its directory: `study.html`, `study.json`, `study.csv`, the bakes and the references.
    """

    document: StudyDocument
    out: Path

    def __repr__(self) -> str:
        points = sum(len(scene.points) for scene in self.document.scenes)
        return f"Study({self.document.name!r}: {len(self.document.scenes)} scenes, {points} points)"

    @property
    def scenes(self) -> list[tuple[SceneRecord, SceneAnalysis]]:
        """Each scene with what its points say together."""
        return list(zip(self.document.scenes, self.document.analyses, strict=True))

    def points(self, **wanted: str | int) -> list[PointRecord]:
        """Points of all scenes that have the values given, of the bake's fields or their own.

        >>> study.points(method="rsibr", samples=256)       # doctest: +SKIP
        """
        return [
            point
            for scene in self.document.scenes
            for point in scene.points
            if all(getattr(point, name, getattr(point.bake, name, None)) == value for name, value in wanted.items())
        ]


@backend.in_session
def study(
    config: StudyConfig | Mapping[str, Any] | Path | str,
    *,
    out: Path | str,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Study:
    """Measure error against time over a sweep, and write what it shows.

    A study that was killed goes on where it was; one whose config has changed keeps every result that is still asked
    for. Bakes and references are shared by all that need them.

    Parameters
    ----------
    config : StudyConfig, mapping or path
        What to vary and how to judge: a TOML file, or its tables (relative paths then start at the working folder).
    out : path
        Directory of the study, made if need be.
    on_progress : callable
        Called before the first step, with the time that all are expected to take, and after each.

    Returns
    -------
    Study
        Also written to `out`: `study.json`, `study.csv`, `study.html`.

    Raises
    ------
    InputError
        If the config, an environment or a material is wrong.
    BakeError
        If another study writes into `out`, or it may not be written to.
    MachineError
        If the machine has no usable backend, or the disk is full.
    """
    settings = _settings(config)
    agenda = agenda_of(settings)
    variant = backend.use()
    folder = Path(out)
    with lock_study(folder):
        start = time.perf_counter()
        benches = _benches(settings, agenda, folder)
        rates = Rates(benches[0].scene)
        todo = [(bench, list(steps_of(bench, agenda, settings.path_tracing, rates))) for bench in benches]
        expected = sum(step.seconds for _, steps in todo for step in steps)
        _run(todo, expected, on_progress)
        scenes = [_scene_record(bench, agenda, settings) for bench in benches]
        document = StudyDocument(
            schema=1,
            name=settings.name,
            judge=_judge_record(settings, benches[0]),
            machine=_machine_record(variant),
            expected_seconds=expected,
            seconds=time.perf_counter() - start,
            scenes=scenes,
            analyses=[analyse(scene, settings.judge.frames) for scene in scenes],
            doubling=doubling_of(scenes, settings.judge.frames),
        )
        write_study(document, folder)
    return Study(document, folder)


def _settings(config: StudyConfig | Mapping[str, Any] | Path | str) -> StudyConfig:
    if isinstance(config, StudyConfig):
        return config
    return parse_study(config) if isinstance(config, Mapping) else load_study(Path(config))


def _benches(settings: StudyConfig, agenda: Agenda, folder: Path) -> list[Bench]:
    resolution = settings.judge.resolution or max(size.resolution for size in agenda)
    frames, journal = judged_views(settings), Journal(folder / JOURNAL_NAME)
    store = TruthStore(folder / REFERENCES_NAME, journal)
    return [
        Bench(JudgedScene(scene, frames, settings.judge, store), journal, folder / BAKES_NAME)
        for scene in load_scenes(settings, resolution)
    ]


def _run(todo: list[tuple[Bench, list[Step]]], total: float, on_progress: Callable[[Progress], None]) -> None:
    done = 0.0
    for bench, steps in todo:
        for step in steps:
            on_progress(Progress(done, total, f"{bench.scene.name}: {step.name}"))
            step.run()
            done += step.seconds
        bench.close()
    on_progress(Progress(total, total, "done"))


def _scene_record(bench: Bench, agenda: Agenda, settings: StudyConfig) -> SceneRecord:
    known = [bench.known_point(size, variant) for size, variants in agenda.items() for variant in variants]
    samples = sorted(settings.path_tracing.samples)
    rivals, progressive = (
        bench.known_path_tracing(samples, each) or [] for each in (None, settings.path_tracing.pass_samples)
    )
    return SceneRecord(
        material=bench.scene.material_name,
        environment=bench.scene.environment_name,
        reference=bench.judged.record(),
        path_tracing=rivals,
        progressive=progressive,
        points=[record for record in known if record is not None],
    )


def _judge_record(settings: StudyConfig, bench: Bench) -> JudgeRecord:
    return JudgeRecord(
        views=[(float(x), float(y), float(z)) for x, y, z in (frame[:, 2] for frame in bench.judged.frames)],
        resolution=bench.scene.resolution,
        reference_samples=settings.judge.samples,
        repeats=settings.judge.repeats,
        frames=settings.judge.frames,
    )


def _machine_record(variant: str) -> MachineRecord:
    packages = {name: version(name) for name in ("mitsuba", "drjit", "numpy")} | {"rsibr": __version__}
    return MachineRecord(
        variant=variant,
        processors=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        packages=packages,
    )

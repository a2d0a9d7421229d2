"""Runs a study: measures what is missing, analyses all results, writes the report."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rsibr import backend, clock
from rsibr.job_size import JobSize
from rsibr.late import late
from rsibr.progress import STUDY, Progress
from rsibr.shown_progress import shows_progress
from rsibr.store.tabular import Tabular
from rsibr.studies.agenda import Agenda, agenda_of
from rsibr.studies.analysis import SceneAnalysis, analyse
from rsibr.studies.bench import Bench
from rsibr.studies.classes import classes_of
from rsibr.studies.config import StudyConfig, load_study, parse_study
from rsibr.studies.document import JudgeRecord, MachineRecord, StepRecord, StudyDocument
from rsibr.studies.doubling import doubling_of
from rsibr.studies.feasible import check_folders, check_sizes
from rsibr.studies.forecast import Forecast, Step
from rsibr.studies.job import study_job
from rsibr.studies.journal import Journal, lock_study
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.page import Drawn
from rsibr.studies.report import CSV_NAME, JSON_NAME, PAGE_NAME, study_table, write_study
from rsibr.studies.results import PointRecord, SceneRecord
from rsibr.studies.scene import judged_views, load_scenes
from rsibr.studies.truth import TruthStore
from rsibr.version import __version__

BAKES_NAME, REFERENCES_NAME, JOURNAL_NAME = "bakes", "references", "journal"


@dataclass(frozen=True, eq=False, repr=False)
class Study(Tabular):
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
        """Each scene with its analysis; empty where only errors were measured."""
        return self.document.analysed

    plot = late("rsibr.publishing.notebooks.plots:plot_study", "Figure of the least error over the time of the job.")
    _repr_html_ = late("rsibr.publishing.notebooks.cards:study_card", "Card for a notebook.")

    def csv(self) -> str:
        """Text of `study.csv`: a row a point."""
        return study_table(self.document)

    def points(self, **wanted: str | int) -> list[PointRecord]:
        """Points of all scenes whose fields, or whose bake's fields, have the given values.

        >>> study.points(samples=256, precision="float32")       # doctest: +SKIP
        """
        return [
            point
            for scene in self.document.scenes
            for point in scene.points
            if all(getattr(point, name, getattr(point.bake, name, None)) == value for name, value in wanted.items())
        ]


@shows_progress(STUDY)
@backend.in_session
def study(
    config: StudyConfig | Mapping[str, Any] | Path | str,
    *,
    out: Path | str,
    on_progress: Callable[[Progress], None] = lambda _: None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
) -> Study:
    """Measure error against time over parameter sweeps, and write the report.

    A study that was killed goes on where it was; one whose config has changed keeps every result that is still asked
    for. Bakes and references are shared by all that need them.

    Parameters
    ----------
    config : StudyConfig, mapping or path
        What to vary and how to judge: a TOML file, or its tables (relative paths then start at the working folder).
    out : path
        Directory of the study, made if need be.
    on_progress : callable
        Called before each step with the time that is expected to be done and in all, and once more at the end. Before
        the first step, what is done is the preparation: start-up, loading, measuring the speed of the machine.
    on_forecast : callable
        Called once with bytes, memory and time of what is left to do, before the first step.
    allow_large : bool
        Start even if the study exceeds the free disk space or memory.

    Returns
    -------
    Study
        Also written to `out`: `study.json`, `study.csv`, `study.html`.

    Raises
    ------
    InputError
        If the config, an environment or a material is wrong, no bake of it can serve a method, or the study exceeds the
        free disk space or memory, unless `allow_large`.
    BakeError
        If another study writes into `out`, or it may not be written to.
    MachineError
        If the machine has no usable backend, the disk is full, or a size of the sweeps fits nowhere.
    """
    on_progress, on_forecast = backend.unlocked(on_progress), backend.unlocked(on_forecast)
    with clock.counting() as begun:
        settings = _settings(config)
        agenda = agenda_of(settings)
        backend.use()
        folder = Path(out)
        with lock_study(folder):
            check_folders(folder, (BAKES_NAME, REFERENCES_NAME, JOURNAL_NAME), (JSON_NAME, CSV_NAME, PAGE_NAME))
            check_sizes(settings, agenda, _judged_resolution(settings, agenda), folder)
            benches = _benches(settings, agenda, folder)
            return _Run(settings, agenda, benches, folder, begun).done(on_progress, on_forecast, allow_large)


@dataclass(eq=False)
class _Run:
    """One run of a study, from its preparation to its page."""

    settings: StudyConfig
    agenda: Agenda
    benches: list[Bench]
    folder: Path
    begun: float
    _steps: list[StepRecord] = field(default_factory=list)

    def done(
        self, on_progress: Callable[[Progress], None], on_forecast: Callable[[JobSize], None], allow_large: bool
    ) -> Study:
        """Do the remaining steps and write the study."""
        forecast = Forecast(self.benches, self.agenda, self.settings.path_tracing)
        todo = [(bench, forecast.steps(number)) for number, bench in enumerate(self.benches)]
        page_seconds = forecast.page_seconds if any(steps for _, steps in todo) else 0.0
        expected = page_seconds + sum(step.seconds for _, steps in todo for step in steps)
        job = study_job(self.benches, self.agenda, expected)
        job.admit(self.folder, allow_large)
        on_forecast(job)
        for bench in self.benches[1:]:  # the first is prepared already, by the measurement of the speed
            bench.scene.release()
        self._note("preparation", self._elapsed, self._elapsed)
        self._work(todo, page_seconds, on_progress)
        document, drawn = self._told(page_seconds)
        write_study(document, self.folder, drawn)
        return Study(document, self.folder)

    @property
    def _elapsed(self) -> float:
        return time.perf_counter() - self.begun

    def _note(self, step: str, expected: float, seconds: float) -> None:
        self._steps.append(StepRecord(step=step, expected_seconds=expected, seconds=seconds))

    def _work(
        self, todo: list[tuple[Bench, list[Step]]], page_seconds: float, on_progress: Callable[[Progress], None]
    ) -> None:
        """Do the steps and record the time of each."""
        left = page_seconds + sum(step.seconds for _, steps in todo for step in steps)
        done = self._steps[0].seconds if left else 0.0  # a finished study has no steps to show progress of
        total = done + left
        for bench, steps in todo:
            for step in steps:
                name, start = f"{bench.scene.name}: {step.name}", time.perf_counter()
                on_progress(Progress(done, total, name))
                step.run()
                done += step.seconds
                self._note(name, step.seconds, time.perf_counter() - start)
            bench.close()
        on_progress(Progress(total, total, "done"))

    def _told(self, page_seconds: float) -> tuple[StudyDocument, Drawn]:
        """Document and figures of all results; the time of drawing is part of the run."""
        start, frames = time.perf_counter(), self.settings.judge.frames
        scenes = [_scene_record(bench, self.agenda, self.settings) for bench in self.benches]
        timed = not self.settings.judge.errors_only
        document = StudyDocument(
            schema=1,
            name=self.settings.name,
            judge=_judge_record(self.settings, self.benches[0]),
            machine=machine_record(backend.use()),
            expected_seconds=sum(step.expected_seconds for step in self._steps) + page_seconds,
            seconds=self._elapsed,
            steps=self._steps,
            scenes=scenes,
            classes=classes_of(scenes),
            analyses=[analyse(scene, frames) for scene in scenes] if timed else [],
            doubling=doubling_of(scenes, frames) if timed else [],
        )
        drawn = Drawn.of(document)
        self._note("page", page_seconds, time.perf_counter() - start)
        return document.model_copy(update={"seconds": self._elapsed, "steps": self._steps}), drawn


def _settings(config: StudyConfig | Mapping[str, Any] | Path | str) -> StudyConfig:
    if isinstance(config, StudyConfig):
        return config
    return parse_study(config) if isinstance(config, Mapping) else load_study(Path(config))


def _judged_resolution(settings: StudyConfig, agenda: Agenda) -> int:
    return settings.judge.resolution or max(size.resolution for size in agenda)


def _benches(settings: StudyConfig, agenda: Agenda, folder: Path) -> list[Bench]:
    resolution = _judged_resolution(settings, agenda)
    frames, journal = judged_views(settings), Journal(folder / JOURNAL_NAME)
    store, compiled = TruthStore(folder / REFERENCES_NAME, journal), dict[str, float]()
    return [
        Bench(JudgedScene(scene, frames, settings.judge, store), journal, folder / BAKES_NAME, compiled)
        for scene in load_scenes(settings, resolution)
    ]


def _scene_record(bench: Bench, agenda: Agenda, settings: StudyConfig) -> SceneRecord:
    known = [bench.known_point(size, variant) for size, variants in agenda.items() for variant in variants]
    samples = sorted(settings.path_tracing.samples)
    rivals, progressive = (
        bench.known_path_tracing(samples, each) or [] for each in (None, settings.path_tracing.pass_samples)
    )
    return SceneRecord(
        material=bench.scene.material_name,
        material_class=bench.scene.material_class,
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


def machine_record(variant: str) -> MachineRecord:
    """Record of this machine and of the versions in use."""
    packages = {name: version(name) for name in ("mitsuba", "drjit", "numpy")} | {"rsibr": __version__}
    return MachineRecord(
        variant=variant,
        processors=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        packages=packages,
    )

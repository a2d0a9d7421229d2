"""Speed of this machine for one scene, measured by a miniature study; the forecast follows from it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rsibr import backend
from rsibr.baking.calibration import map_overhead
from rsibr.geometry.viewpoints import icosphere
from rsibr.methods.registry import judged_by_lobe
from rsibr.scene.views import load_viewpoints
from rsibr.studies import figures
from rsibr.studies.agenda import Agenda, BakeSize, Variant, variant_as_is
from rsibr.studies.baked import BakedMaps
from rsibr.studies.bench import Bench
from rsibr.studies.config import JudgeConfig
from rsibr.studies.journal import Journal
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.results import BakeRecord, PointRecord, Positive, Record
from rsibr.studies.scene import StudyScene
from rsibr.studies.truth import TruthStore
from rsibr.validation.eval_error import POINTS
from rsibr.validation.eval_error import TIMED_RUNS as EVAL_RUNS
from rsibr.validation.metrics import compare
from rsibr.validation.reference import MINIMUM_BUFFERS

MAX_LANES = 2**19
"""Samples of a long launch of the probe: enough to keep the cores busy."""

FEW_SAMPLES = 4
"""Samples a texel of the first bake of the probe."""

VIEWS = 2
"""Judged views of the probe, at most."""

REPEATS = 3
"""Timed runs of a picture in the probe; the shortest of a path-traced picture counts."""


MUCH_COMPILED = 0.1
"""Share of compilation in the time of a point above which the point is measured again, compiled."""


class PathTracingRates(Record):
    """Time of a path-traced picture: launches × launch_seconds + samples × sample_seconds, all compiled."""

    launch_seconds: Positive
    sample_seconds: Positive = Field(description="one sample of one texel")
    compile_seconds: Positive = Field(description="for each new number of samples of a launch")
    scene_seconds: Positive = Field(description="once a scene: building it")


class BakeRates(Record):
    """Time of a bake: setup_seconds + views × (view_seconds + store_seconds + samples × sample_seconds)."""

    setup_seconds: Positive = Field(description="planning, opening, checking: a bake in a scene that is prepared")
    view_seconds: Positive
    store_seconds: Positive = Field(description="a map is checked, compressed and written")
    sample_seconds: Positive = Field(description="one sample of one covered texel")
    scene_seconds: Positive = Field(description="once a scene: probes, lobe fits, light tables, compilation")


class MethodRates(Record):
    """Time of one point of a method."""

    point_seconds: Positive = Field(description="the point of the probe, all compiled")
    compile_seconds: Positive = Field(description="beyond that where the kernels are new")
    frame_seconds: Positive = Field(description="a picture")
    lookup_seconds: Positive = Field(description="one evaluation of eval")
    preparations: int = Field(description="times that the method is made ready, see `preparations`")


class Rates(Record):
    """All figures that a forecast needs, with the sizes that they were measured at."""

    views: int = Field(description="stored views of the probe")
    resolution: int = Field(description="texels a side of its maps")
    judged: int = Field(description="judged views of the probe")
    repeats: int = Field(description="timed runs of each picture of the probe")
    path_tracing: PathTracingRates
    bake: BakeRates
    methods: dict[str, MethodRates]
    decode_seconds: Positive = Field(description="one map is read and decoded")
    compare_seconds: Positive = Field(description="a picture is compared with its reference")
    figure_seconds: Positive = Field(description="one figure of the page")

    def frame_work(self, method: str, texels: float, repeats: int) -> float:
        """Time that one more judged view adds to a point [s]; `texels` are those that are judged."""
        rates = self.methods[method]
        pictures = 1 + repeats + rates.preparations
        lookups = (EVAL_RUNS + 1) * POINTS * texels
        return self.compare_seconds + pictures * rates.frame_seconds + lookups * rates.lookup_seconds

    def view_work(self, method: str) -> float:
        """Time that one more stored view adds to a point [s]: decoded twice, looked at in each preparation."""
        rates = self.methods[method]
        return 2 * self.decode_seconds + rates.preparations * rates.frame_seconds


def view_count(scene: StudyScene, size: BakeSize) -> int:
    """Number of stored views of a bake."""
    return len(icosphere(size.subdivision) if size.subdivision is not None else load_viewpoints(scene.config.views))


def measure_rates(
    scene: StudyScene, agenda: Agenda, frames: Sequence[NDArray[np.float64]], compiled: dict[str, float]
) -> Rates:
    """Measure the speed of this machine with two small bakes, a point of each method, and path-traced pictures.

    Kernels and shared parts of the scene stay in memory, so that the study does not make them again.

    Parameters
    ----------
    scene : StudyScene
        Scene to measure with.
    agenda : Agenda
        Bakes and variants of the study: of its least bake and of each of its methods the rates are measured.
    frames : sequence of ndarray, shape (3, 3)
        Judged views; the first ones are used.
    compiled : dict of str to float
        Takes the compilation times that are found, see `Bench.compiled`.
    """
    with TemporaryDirectory(prefix="rsibr-probe-") as folder:
        return _Probe.of(scene, agenda, frames[:VIEWS], compiled, Path(folder)).rates()


def preparations(scene: StudyScene, method: str) -> int:
    """Times that a point of a method makes it ready: with the maps, with noisy maps, and for each lobe by itself."""
    lobes = scene.prepared.parts.split.names if judged_by_lobe(method) and scene.prepared.keeps_apart else []
    return 2 + (len(lobes) if len(lobes) > 1 else 0)


@dataclass(frozen=True)
class _TimedPoint:
    """A point of the probe, and the wall time of measuring it [s]."""

    variant: Variant
    point: PointRecord
    seconds: float


@dataclass(eq=False)
class _Probe:
    """A study in miniature: few samples, few judged views, the variants of each method as it is."""

    bench: Bench
    size: BakeSize
    variants: list[Variant]

    @classmethod
    def of(
        cls,
        scene: StudyScene,
        agenda: Agenda,
        frames: Sequence[NDArray[np.float64]],
        compiled: dict[str, float],
        folder: Path,
    ) -> _Probe:
        least = min(agenda, key=lambda size: view_count(scene, size) * size.resolution**2)
        methods = dict.fromkeys(variant.method for variants in agenda.values() for variant in variants)
        journal = Journal(folder / "journal")
        judge = JudgeConfig(samples=MINIMUM_BUFFERS, repeats=REPEATS)
        judged = JudgedScene(scene, frames, judge, TruthStore(folder / "references", journal))
        bench = Bench(judged, journal, folder / "bakes", compiled)
        return cls(bench, replace(least, samples=FEW_SAMPLES), [variant_as_is(name) for name in methods])

    @property
    def scene(self) -> StudyScene:
        return self.bench.scene

    def rates(self) -> Rates:
        path_tracing = self._path_tracing()
        few, many = self.size, replace(self.size, samples=self._many(math.pi / 4 * self.size.resolution**2))
        _ = self.bench.judged.references
        first = _seconds(lambda: self.bench.bake(few))
        points = [self._point(few, variant) for variant in self.variants]
        second = _seconds(lambda: self.bench.bake(many))
        methods = {timed.point.method: self._method(timed, many) for timed in points}
        return Rates(
            views=points[0].point.bake.views,
            resolution=self.size.resolution,
            judged=len(self.bench.judged.frames),
            repeats=REPEATS,
            path_tracing=path_tracing,
            bake=self._bake(first, second),
            methods=methods,
            decode_seconds=self._decode(),
            compare_seconds=self._compare(),
            figure_seconds=_seconds(lambda: figures.svg_uri(figures.whereabouts([timed.point for timed in points]))),
        )

    def _many(self, texels: float) -> int:
        return max(4 * FEW_SAMPLES, round(MAX_LANES / texels))

    def _path_tracing(self) -> PathTracingRates:
        """Two numbers of samples separate the time of a launch from that of a sample; first runs compile."""
        built = _seconds(lambda: self.scene.tracer)
        tracer, frame = self.scene.tracer, self.bench.judged.frames[0]
        seeds, texels = np.random.SeedSequence(0), tracer.resolution**2
        many = self._many(texels)
        first, times, work = [], [], []
        for samples in (many // 8, many):
            first.append(_seconds(lambda samples=samples: tracer.picture(frame, samples, seeds)))  # type: ignore[misc]
            times.append(min(tracer.picture(frame, samples, seeds)[1] for _ in range(REPEATS)))
            work.append(texels * math.prod(tracer.launches(samples)))
        rate = max(0.0, times[1] - times[0]) / (work[1] - work[0])
        compilation = max(0.0, first[1] - 2 * times[1])
        return PathTracingRates(
            launch_seconds=max(0.0, times[0] - rate * work[0]),
            sample_seconds=rate,
            compile_seconds=compilation,
            scene_seconds=built + max(0.0, first[0] - 2 * times[0] - compilation),
        )

    def _point(self, size: BakeSize, variant: Variant) -> _TimedPoint:
        start = time.perf_counter()
        point = self.bench.measure(size, variant)
        backend.synchronize()
        return _TimedPoint(variant, point, time.perf_counter() - start)

    def _bake(self, first: float, second: float) -> BakeRates:
        """The second bake is compiled and shares all parts of the scene; the difference to the first is their time."""
        few, many = cast(BakeRecord, self.bench.known_bake(self.size)), cast(BakedMaps, self.bench.opened).record
        views = few.views
        texels = math.pi / 4 * self.size.resolution**2
        short, long = few.views_seconds.median, many.views_seconds.median
        rate = max(0.0, long - short) / (views * texels * (many.samples - few.samples))
        store = map_overhead(self.scene.prepared.parts.integrator(self.size.resolution, self.scene.rendering))
        beside = max(0.0, second - long)
        return BakeRates(
            setup_seconds=max(0.0, beside - views * store),
            view_seconds=max(0.0, short / views - rate * texels * few.samples),
            store_seconds=min(store, beside / views),
            sample_seconds=rate,
            scene_seconds=max(0.0, first - short - beside),
        )

    def _method(self, cold: _TimedPoint, size: BakeSize) -> MethodRates:
        """Rates from a first point; where much of it was compilation, a second point gives the time without."""
        name, compilation = cold.point.method, min(cold.point.compile_seconds, cold.seconds)
        if compilation > MUCH_COMPILED * cold.seconds:
            compilation = max(0.0, cold.seconds - self._point(size, cold.variant).seconds)
        return MethodRates(
            point_seconds=cold.seconds - compilation,
            compile_seconds=compilation,
            frame_seconds=cold.point.frame_seconds.median,
            lookup_seconds=cold.point.eval_seconds.median if cold.point.eval_seconds else 0.0,
            preparations=preparations(self.scene, name),
        )

    def _decode(self) -> float:
        return _seconds(lambda: cast(BakedMaps, self.bench.opened).bake.map(0))

    def _compare(self) -> float:
        judged = self.bench.judged
        truth = judged.references[0]
        return _seconds(lambda: compare(truth.mean, truth, judged.exposures, name="probe"))


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    backend.synchronize()
    return time.perf_counter() - start

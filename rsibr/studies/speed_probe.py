"""Measures the rates of a forecast with a miniature study: two small bakes, a point of each method, path tracing."""

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

from rsibr import backend
from rsibr.baking.calibration import map_overhead
from rsibr.studies import figures
from rsibr.studies.agenda import Agenda, BakeSize, Variant, variant_as_is
from rsibr.studies.baked import BakedMaps
from rsibr.studies.bench import Bench
from rsibr.studies.config import JudgeConfig
from rsibr.studies.journal import Journal
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.rates import BakeRates, MethodRates, PathTracingRates, Rates, preparations, view_count
from rsibr.studies.results import BakeRecord, PointRecord
from rsibr.studies.scene import StudyScene
from rsibr.studies.truth import TruthStore
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


def measure_rates(
    scene: StudyScene,
    agenda: Agenda,
    frames: Sequence[NDArray[np.float64]],
    compiled: dict[str, float],
    errors_only: bool = False,
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
    errors_only : bool
        See `rsibr.studies.config.JudgeConfig`.
    """
    with TemporaryDirectory(prefix="rsibr-probe-") as folder:
        return _Probe.of(scene, agenda, frames[:VIEWS], compiled, errors_only, Path(folder)).rates()


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
        errors_only: bool,
        folder: Path,
    ) -> _Probe:
        least = min(agenda, key=lambda size: view_count(scene, size) * size.resolution**2)
        methods = dict.fromkeys(variant.method for variants in agenda.values() for variant in variants)
        journal = Journal(folder / "journal")
        judge = JudgeConfig(samples=MINIMUM_BUFFERS, repeats=REPEATS, errors_only=errors_only)
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
            reread_seconds=_seconds(self.bench.judged.record) / len(self.bench.judged.frames),
            figure_seconds=self._figure([timed.point for timed in points]),
        )

    def _figure(self, points: list[PointRecord]) -> float:
        if self.bench.judged.judge.errors_only:
            return 0.0  # there are none on the page
        return _seconds(lambda: figures.svg_uri(figures.whereabouts(points)))

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
            preparations=preparations(self.scene, name, self.bench.judged.judge),
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

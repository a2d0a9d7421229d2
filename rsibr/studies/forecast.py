"""Remaining steps of a study, each with its expected time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

from rsibr.methods.registry import judged_by_lobe
from rsibr.store.manifest import canonical
from rsibr.studies.agenda import Agenda, Variant
from rsibr.studies.axes import PER_TEXEL
from rsibr.studies.bench import Bench
from rsibr.studies.config import PathTracingConfig
from rsibr.studies.lobes import lobe_key
from rsibr.studies.rates import Rates, preparations, view_count
from rsibr.studies.speed_probe import measure_rates
from rsibr.studies.truth import reference_key
from rsibr.validation.reference import LANES_PER_LAUNCH, MINIMUM_BUFFERS, stratified

FIGURES = 3
"""Figures of each scene on the page; the headline figure is extra."""


@dataclass(frozen=True)
class Step:
    """One piece of work; its result is kept once it is done.

    Attributes
    ----------
    name : str
        Name to show.
    seconds : float
        Expected time [s].
    run : callable
        Does the work.
    """

    name: str
    seconds: float
    run: Callable[[], object]


@dataclass(eq=False)
class Forecast:
    """Lists the steps of each scene with their expected times.

    Attributes
    ----------
    benches : sequence of Bench
        One a scene; the first one is measured with.
    agenda : Agenda
        Bakes, and the pictures of each.
    path_tracing : PathTracingConfig
        Samples of the path-traced pictures.
    measure : callable
        Measures the rates; see `measure_rates`.
    """

    benches: Sequence[Bench]
    agenda: Agenda
    path_tracing: PathTracingConfig
    measure: Callable[..., Rates] = measure_rates
    _compiled: set[tuple[object, ...]] = field(default_factory=set)

    @cached_property
    def rates(self) -> Rates:
        """Speed of the machine; measured once a study, at the first use: a finished study measures nothing."""
        first, agenda = self.benches[0], self._missing() or self.agenda
        methods = {variant.method for variants in agenda.values() for variant in variants}
        key = first.key("rates", resolutions=sorted({size.resolution for size in self.agenda}))
        known = first.journal.find(key)
        if known is not None and methods <= set(known["methods"]):
            return Rates.model_validate_json(canonical(known))  # of an earlier run: here nothing is compiled yet
        judged = first.judged
        rates = self.measure(first.scene, agenda, judged.frames, first.compiled, judged.judge.errors_only)
        first.journal.store(key, rates.model_dump(mode="json"))
        self._compiled |= {("scene", 0), ("tracer", 0)}
        self._compiled |= {_kernel(name, PER_TEXEL, "", rates.resolution) for name in rates.methods}
        return rates

    def _missing(self) -> Agenda:
        """Part of the agenda with points that are missing in some scene."""
        missing = {
            size: [variant for variant in variants if any(b.known_point(size, variant) is None for b in self.benches)]
            for size, variants in self.agenda.items()
        }
        return {size: variants for size, variants in missing.items() if variants}

    def steps(self, number: int) -> list[Step]:
        """Remaining steps in one scene; results in the journal are not measured again."""
        bench = self.benches[number]
        rivals = [] if bench.judged.judge.errors_only else self._rivals(number, bench)
        return [*self._truths(number, bench), *rivals, *self._points(number, bench)]

    @property
    def page_seconds(self) -> float:
        """Time to read the references once more, and to draw the page."""
        views = sum(len(bench.judged.frames) for bench in self.benches)
        return self.rates.reread_seconds * views + self.rates.figure_seconds * (1 + FIGURES * len(self.benches))

    def _truths(self, number: int, bench: Bench) -> Iterator[Step]:
        scene, samples = bench.scene, bench.judged.judge.samples
        texels = scene.resolution**2
        lobed = not bench.judged.judge.errors_only and any(
            judged_by_lobe(variant.method) for variants in self.agenda.values() for variant in variants
        )
        for index, frame in enumerate(bench.judged.frames, 1):
            if not bench.judged.store.has(reference_key(scene, frame, samples)):
                wanted = -(-samples // MINIMUM_BUFFERS)
                passes = -(-wanted * texels // LANES_PER_LAUNCH)
                each = stratified(-(-wanted // passes))
                seconds = self._rendered(number, MINIMUM_BUFFERS * passes, each, texels)
                yield Step(f"reference {index}", seconds, partial(bench.judged.reference, frame))
            if lobed and not bench.judged.store.has(lobe_key(scene, frame, samples)):
                bake = self.rates.bake
                seconds = math.pi / 4 * texels * samples * bake.sample_seconds + MINIMUM_BUFFERS * bake.view_seconds
                seconds += self._first(("scene", number), bake.scene_seconds)
                yield Step(f"lobes of reference {index}", seconds, partial(bench.judged.lobe_truth, frame))

    def _rivals(self, number: int, bench: Bench) -> Iterator[Step]:
        judged, samples = bench.judged, sorted(self.path_tracing.samples)
        pictures, texels = max(judged.judge.repeats, len(judged.frames)), bench.scene.resolution**2
        for pass_samples in (None, self.path_tracing.pass_samples):
            if bench.known_path_tracing(samples, pass_samples) is None:
                seconds = len(samples) * len(judged.frames) * self.rates.compare_seconds
                for count in samples:
                    launches, each = self.benches[0].scene.tracer.launches(count, pass_samples)
                    seconds += self._rendered(number, pictures * launches, each, texels)
                name = "path tracing" if pass_samples is None else "path tracing in passes"
                yield Step(name, seconds, partial(bench.path_tracing, samples, pass_samples))

    def _rendered(self, number: int, launches: int, each: int, texels: int) -> float:
        """Time of path-traced launches of `each` samples a texel; the first one of its size compiles."""
        rates = self.rates.path_tracing
        launch = rates.launch_seconds + texels * each * rates.sample_seconds
        first = self._first(("launch", number, each), rates.compile_seconds + launch)
        return launches * launch + first + self._first(("tracer", number), rates.scene_seconds)

    def _points(self, number: int, bench: Bench) -> Iterator[Step]:
        for size, variants in self.agenda.items():
            missing = [variant for variant in variants if bench.known_point(size, variant) is None]
            if not missing:
                continue
            views, rates = view_count(bench.scene, size), self.rates.bake
            view = rates.view_seconds + math.pi / 4 * size.resolution**2 * size.samples * rates.sample_seconds
            seconds = rates.setup_seconds + views * (view + rates.store_seconds)
            seconds += self._first(("scene", number), rates.scene_seconds)
            name = f"bake of {views} views, {size.resolution}², {size.samples} samples"
            yield Step(name, seconds, partial(bench.bake, size))
            for variant in missing:
                seconds = self._point(bench, views, size.resolution, variant)
                yield Step(f"{variant} of {views} views", seconds, partial(bench.measure, size, variant))

    def _point(self, bench: Bench, views: int, resolution: int, variant: Variant) -> float:
        """Time of a point: that of the probe, in proportion to the lobes, with more views and new kernels."""
        rates, judged = self.rates, bench.judged
        method = rates.methods[variant.method]
        texels = math.pi / 4 * bench.scene.resolution**2
        lobes = preparations(bench.scene, variant.method, judged.judge) / method.preparations
        seconds = lobes * method.point_seconds + (views - rates.views) * rates.view_work(variant.method)
        more = len(judged.frames) * rates.frame_work(variant.method, texels, judged.judge.repeats)
        seconds += more - rates.judged * rates.frame_work(variant.method, texels, rates.repeats)
        weights = "" if variant.has_own_weights else variant.weights
        kernel = _kernel(variant.method, variant.warp, weights, resolution)
        return max(seconds, 0.0) + self._first(kernel, method.compile_seconds)

    def _first(self, key: tuple[object, ...], seconds: float) -> float:
        """Return `seconds` where `key` was not asked for before, else 0."""
        _ = self.rates  # fills `_compiled` with the kernels of the probe
        if key in self._compiled:
            return 0.0
        self._compiled.add(key)
        return seconds


def _kernel(method: str, warp: str, weights: str, resolution: int) -> tuple[object, ...]:
    """Key of a method's kernel, as the forecast distinguishes kernels."""
    return ("method", method, warp != PER_TEXEL, weights, resolution)

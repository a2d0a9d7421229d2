"""The steps of a study that are still to be done, and how long each will take, from a quick probe of the machine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from rsibr import backend
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import icosphere
from rsibr.methods.registry import judged_by_lobe
from rsibr.scene.views import load_viewpoints
from rsibr.studies.agenda import Agenda, BakeSize, Variant
from rsibr.studies.bench import Bench
from rsibr.studies.config import PathTracingConfig
from rsibr.studies.lobes import lobe_key
from rsibr.studies.scene import StudyScene
from rsibr.studies.truth import reference_key

_PROBE_RESOLUTION = 48
_PROBE_SAMPLES = 64

# What things take beside their samples, measured on two cores: no closer than the machine is steady.
_PER_VIEW = 0.04  # a map is launched in blocks, checked, compressed and synced to the disk
_PER_BAKE = 0.6  # environment, material and lobes are loaded and fitted, kernels taken from the disk
_PER_TRUTH = 0.2
_PER_POINT = 0.15  # maps go to the device, kernels are compiled
_PER_PICTURE = 0.004
_PER_COMPARISON = 0.03
_UNTIMED_PICTURES = 4  # one that compiles, two for the noise, one of each lobe


@dataclass(frozen=True)
class Step:
    """One piece of work, kept for good once it is done.

    Attributes
    ----------
    name : str
        As a person reads it.
    seconds : float
        What it is expected to take.
    run : callable
        Does it.
    """

    name: str
    seconds: float
    run: Callable[[], object]


class Rates:
    """How fast the machine is, kernels compiled; measured when it is first asked for.

    Parameters
    ----------
    scene : StudyScene
        What to measure with: the second run of a small bake, and of a small path-traced picture.
    """

    def __init__(self, scene: StudyScene) -> None:
        self._scene = scene
        self._frame, self._seeds = view_frame((1.0, 2.0, 3.0)), np.random.SeedSequence(0)

    @cached_property
    def bake(self) -> float:
        """Samples a second of the bake."""
        integrator = self._scene.prepared.parts.integrator(_PROBE_RESOLUTION, self._scene.rendering)
        with backend.rendering(self._scene.rendering):
            seconds = _seconds_of(lambda: integrator.block(self._frame, _PROBE_SAMPLES, self._seeds))
        return float(integrator.coverage.sum()) * _PROBE_SAMPLES / seconds

    @cached_property
    def path_tracing(self) -> float:
        """Samples a second of path tracing."""
        tracer = self._scene.tracer
        seconds = _seconds_of(lambda: tracer.picture(self._frame, _PROBE_SAMPLES, self._seeds))
        return self._scene.resolution**2 * _PROBE_SAMPLES / seconds


def steps_of(bench: Bench, agenda: Agenda, path_tracing: PathTracingConfig, rates: Rates) -> Iterator[Step]:
    """List what is still to be measured in a scene, in order.

    Parameters
    ----------
    bench : Bench
        Where the scene is measured; what its journal knows is no step any more.
    agenda : Agenda
        Bakes, and the pictures of each.
    path_tracing : PathTracingConfig
        Samples of the path-traced pictures.
    rates : Rates
        How fast the machine is.
    """
    yield from _truths(bench, agenda, rates)
    samples, pictures = sorted(path_tracing.samples), max(bench.judged.judge.repeats, len(bench.judged.frames))
    for pass_samples in (None, path_tracing.pass_samples):
        if bench.known_path_tracing(samples, pass_samples) is None:
            texels = bench.scene.resolution**2
            seconds = (pictures + 1) * texels * sum(samples) / rates.path_tracing
            name = "path tracing" if pass_samples is None else "path tracing in passes"
            comparisons = len(samples) * len(bench.judged.frames) * _PER_COMPARISON
            yield Step(name, seconds + comparisons, partial(bench.path_tracing, samples, pass_samples))
    for size, variants in agenda.items():
        missing = [variant for variant in variants if bench.known_point(size, variant) is None]
        if missing:
            yield from _bake(bench, size, missing, rates)


def _truths(bench: Bench, agenda: Agenda, rates: Rates) -> Iterator[Step]:
    scene, samples = bench.scene, bench.judged.judge.samples
    work = scene.resolution**2 * samples
    lobed = any(judged_by_lobe(variant.method) for variants in agenda.values() for variant in variants)
    for number, frame in enumerate(bench.judged.frames, 1):
        if not bench.judged.store.has(reference_key(scene, frame, samples)):
            seconds = _PER_TRUTH + work / rates.path_tracing
            yield Step(f"reference {number}", seconds, partial(bench.judged.reference, frame))
        if lobed and not bench.judged.store.has(lobe_key(scene, frame, samples)):
            seconds = _PER_TRUTH + math.pi / 4 * work / rates.bake
            yield Step(f"lobes of reference {number}", seconds, partial(bench.judged.lobe_truth, frame))


def _bake(bench: Bench, size: BakeSize, variants: Sequence[Variant], rates: Rates) -> Iterator[Step]:
    views = _view_count(bench.scene, size)
    name = f"bake of {views} views, {size.resolution}², {size.samples} samples"
    a_view = _PER_VIEW + math.pi / 4 * size.resolution**2 * size.samples / rates.bake
    yield Step(name, _PER_BAKE + views * a_view, partial(bench.bake, size))
    pictures = len(bench.judged.frames) * (bench.judged.judge.repeats + _UNTIMED_PICTURES)
    seconds = _PER_POINT + pictures * _PER_PICTURE + len(bench.judged.frames) * _PER_COMPARISON
    for variant in variants:
        yield Step(f"{variant} of {views} views", seconds, partial(bench.measure, size, variant))


def _view_count(scene: StudyScene, size: BakeSize) -> int:
    return len(icosphere(size.subdivision) if size.subdivision is not None else load_viewpoints(scene.config.views))


def _seconds_of(work: Callable[[], object]) -> float:
    work()
    start = time.perf_counter()
    work()
    backend.synchronize()
    return time.perf_counter() - start

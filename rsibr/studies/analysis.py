"""Analysis of the points of one scene: convergence, Pareto fronts, comparison with path tracing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydantic import Field

from rsibr.studies.convergence import PowerLaw, fit_flattening, fit_power_law
from rsibr.studies.fronts import front_of
from rsibr.studies.results import PathTracingRecord, PointRecord, Positive, Record, SceneRecord
from rsibr.validation.results import break_even_views

JOBS = (1, 10, 100, 1000, 10_000)
"""Numbers of pictures for which the crossover with path tracing is computed."""

COSTS: dict[str, Callable[[PointRecord], float]] = {
    "once_seconds": lambda point: point.once_seconds,
    "bytes": lambda point: float(point.bytes),
    "frame_seconds": lambda point: point.frame_seconds.median,
}
"""Costs, each with a Pareto front."""


class SlopeRecord(Record):
    """A straight line on logarithmic axes: relMSE = scale·seconds^slope."""

    slope: float
    ci95: tuple[float, float]
    scale: Positive
    seconds: tuple[float, float] = Field(description="range of the times that it was fitted to")
    points: int = Field(description="that it was fitted to")
    is_measured: bool = Field(description="the interval is narrow enough for a statement; else the slope is unknown")

    @classmethod
    def of(cls, law: PowerLaw) -> SlopeRecord:
        """Record of a fit."""
        return cls(
            slope=law.slope,
            ci95=law.ci95,
            scale=law.scale,
            seconds=law.range,
            points=law.points,
            is_measured=law.is_measured,
        )

    @property
    def law(self) -> PowerLaw:
        """The fitted power law."""
        return PowerLaw(self.slope, self.scale, self.ci95, self.seconds, self.points)


class ConvergenceRecord(Record):
    """Fit of relMSE = bias + noise/samples to points that differ only in the samples of the bake."""

    label: str
    points: list[str] = Field(description="labels, by rising samples")
    slope: SlopeRecord | None = Field(
        description="of error against the rendering time of the views; null where an error is not positive"
    )
    bias: Positive = Field(description="fitted: the error in the limit of many samples")
    noise: Positive = Field(description="fitted, times samples")
    predicted_noise: Positive = Field(
        description="from the stored variance, times samples: geometric mean of the points"
    )
    flattens_at_samples: float | None = Field(description="where noise and bias are equal; null without a bias")
    flattens_at_seconds: float | None = Field(description="the same in rendering time of the views")


class FrontRecord(Record):
    """A Pareto front of relMSE over one cost."""

    on: list[str] = Field(description="labels, in ascending order of cost")
    dominated: dict[str, str] = Field(description="every other point, and a point with less error at no more cost")


class RivalRow(Record):
    """A point compared with path tracing at equal time of the whole job and at equal error."""

    label: str
    rel_mse: float
    job_seconds: Positive = Field(description="bake, preparation, compilation and all pictures of the job")
    path_tracing_rel_mse: Positive | None = Field(
        description="relMSE of path tracing in the same time; null beyond its measured times if its slope is unknown"
    )
    frame_seconds: Positive
    path_tracing_seconds: float | None = Field(
        description="path-traced picture of equal relMSE; null if that is not positive, or not measurable"
    )
    break_even_views: int | None = Field(
        description="pictures after which bake, preparation and compilation have paid for themselves; null: never, or "
        "unknown where path_tracing_seconds is null"
    )
    extrapolated: bool = Field(description="the value for path tracing lies outside the measured range")


class CrossoverRecord(Record):
    """Range of job times in which a bake has less error than path tracing, for one number of pictures."""

    pictures: int
    from_seconds: float | None = Field(description="of the whole job; null: never")
    from_point: str | None
    until_seconds: float | None = Field(
        description="when path tracing reaches the error of that point; null: never, or not measurable"
    )
    until_point: str | None
    is_measured: bool = Field(True, description="false where times of path tracing are beyond what was measured")


class SceneAnalysis(Record):
    """Everything that follows from the points of a scene."""

    path_tracing: SlopeRecord
    progressive: SlopeRecord = Field(description="path tracing in passes; the slope is -1 for independent passes")
    convergence: list[ConvergenceRecord]
    fronts: dict[str, FrontRecord] = Field(description="over once_seconds, bytes and frame_seconds")
    job_front: list[str] = Field(description="Pareto front of error over the time of the whole job")
    rivals: list[RivalRow] = Field(description="every point, in ascending order of job_seconds")
    crossover: list[CrossoverRecord]


def analyse(scene: SceneRecord, frames: int) -> SceneAnalysis:
    """Analyse the points of a scene.

    Parameters
    ----------
    scene : SceneRecord
    frames : int
        Pictures of the job in `rivals` and `job_front`.
    """
    law, points = _law(scene.path_tracing), scene.points
    on = front_of([point.job_seconds(frames) for point in points], [point.rel_mse for point in points]).on
    rivals = [_rival(point, law, frames) for point in points]
    return SceneAnalysis(
        path_tracing=SlopeRecord.of(law),
        progressive=SlopeRecord.of(_law(scene.progressive)),
        convergence=convergence_of(points),
        fronts={name: _front(points, cost) for name, cost in COSTS.items()},
        job_front=[points[index].label for index in on],
        rivals=sorted(rivals, key=lambda row: row.job_seconds),
        crossover=[crossover(points, law, pictures) for pictures in JOBS],
    )


def _law(pictures: Sequence[PathTracingRecord]) -> PowerLaw:
    """Power law of the error of path tracing over time; errors below the noise floor count as the noise floor."""
    tiny = float(np.finfo(np.float32).tiny)
    errors = [max(p.error.rel_mse.resolved, tiny) for p in pictures]
    return fit_power_law([p.seconds.median for p in pictures], errors)


def convergence_of(points: Sequence[PointRecord]) -> list[ConvergenceRecord]:
    """Fit every curve with at least three numbers of samples."""
    curves: dict[str, list[PointRecord]] = {}
    for point in sorted(points, key=lambda point: point.bake.samples):
        curves.setdefault(point.curve, []).append(point)
    return [_convergence(label, curve) for label, curve in curves.items() if len(curve) >= 3]


def _convergence(label: str, curve: Sequence[PointRecord]) -> ConvergenceRecord:
    # Rendering time alone, as of the path-traced pictures: set-up is constant and would bend the line
    samples, seconds = [p.bake.samples for p in curve], [p.bake.views_seconds.median for p in curve]
    errors = [p.rel_mse for p in curve]
    known = [(n, e) for n, e in zip(samples, errors, strict=True) if e > 0]
    flattening = fit_flattening(*zip(*known, strict=True)) if len(known) >= 2 else None
    at = flattening.samples if flattening else None
    predicted = [p.noise * p.bake.samples for p in curve if p.noise]
    return ConvergenceRecord(
        label=label,
        points=[p.label for p in curve],
        slope=SlopeRecord.of(fit_power_law(seconds, errors)) if min(errors) > 0 else None,
        bias=flattening.bias if flattening else 0.0,
        noise=flattening.noise if flattening else 0.0,
        predicted_noise=float(np.exp(np.mean(np.log(predicted)))) if predicted else 0.0,
        flattens_at_samples=at,
        flattens_at_seconds=None if at is None else _seconds_at(samples, seconds, at),
    )


def _seconds_at(samples: Sequence[float], seconds: Sequence[float], wanted: float) -> float:
    """Rendering time at a number of samples, from a straight line through the measured times."""
    rate, start = np.polyfit(samples, seconds, 1)
    return float(max(start + rate * wanted, 0.0))


def _front(points: Sequence[PointRecord], cost: Callable[[PointRecord], float]) -> FrontRecord:
    front = front_of([cost(point) for point in points], [point.rel_mse for point in points])
    dominated = {points[index].label: points[by].label for index, by in sorted(front.dominated.items())}
    return FrontRecord(on=[points[index].label for index in front.on], dominated=dominated)


def _rival(point: PointRecord, law: PowerLaw, frames: int) -> RivalRow:
    job, frame = point.job_seconds(frames), point.frame_seconds.median
    equal = _within(law, law.where(point.rel_mse))
    asked = [job / frames, *([equal] if equal else [])]
    return RivalRow(
        label=point.label,
        rel_mse=point.rel_mse,
        job_seconds=job,
        path_tracing_rel_mse=law.at(job / frames) if law.covers(job / frames) else None,
        frame_seconds=frame,
        path_tracing_seconds=equal,
        break_even_views=None if equal is None else break_even_views(point.once_seconds, equal, frame),
        extrapolated=any(not law.range[0] <= seconds <= law.range[1] for seconds in asked),
    )


def _within(law: PowerLaw, seconds: float | None) -> float | None:
    """Return the time if the law can be trusted there, else None."""
    return seconds if seconds is not None and law.covers(seconds) else None


def crossover(points: Sequence[PointRecord], law: PowerLaw, pictures: int) -> CrossoverRecord:
    """Find the range of job times in which some point has less error than path tracing in the same time.

    Parameters
    ----------
    points : sequence of PointRecord
    law : PowerLaw
        relMSE of a path-traced picture against its seconds.
    pictures : int
        Pictures of the job; path tracing spends an equal share of the time on each.
    """
    jobs = [(point.job_seconds(pictures), point) for point in points]
    known = [(job, point) for job, point in jobs if law.covers(job / pictures)]
    better = [(job, point) for job, point in known if point.rel_mse < law.at(job / pictures)]
    if not better:
        return CrossoverRecord(
            pictures=pictures,
            from_seconds=None,
            from_point=None,
            until_seconds=None,
            until_point=None,
            is_measured=len(known) == len(jobs),
        )
    start, first = min(better, key=lambda found: found[0])
    best = min((point for _, point in better), key=lambda point: point.rel_mse)
    overtaken = law.where(best.rel_mse)
    return CrossoverRecord(
        pictures=pictures,
        from_seconds=start,
        from_point=first.label,
        until_seconds=None if overtaken is None or not law.covers(overtaken) else pictures * overtaken,
        until_point=best.label,
        is_measured=overtaken is None or law.covers(overtaken),
    )

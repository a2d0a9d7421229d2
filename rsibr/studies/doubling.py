"""Gain of twice the time: by how much it divides the error, for each method and time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from rsibr.studies.convergence import LEAST_POINTS, WIDEST, fit_power_law
from rsibr.studies.fronts import front_of
from rsibr.studies.results import PointRecord, Positive, Record, SceneRecord
from rsibr.validation.report.estimate_document import EstimateModel

PATH_TRACING = "path tracing"

MOST_OF_NOISE = 4.0
"""Largest gain of a path tracer: the variance of jittered samples falls as N⁻² at best, in two dimensions (Mitchell,
1996, *Consequences of Stratified Sampling in Graphics*). More is scatter, or the constant part of short times."""

_Z = 1.96
"""Standard errors of half a 95 % interval."""


class DoublingRecord(Record):
    """Least error of a method over the time of the whole job; geometric means over all scenes."""

    method: str
    labels: list[str] = Field(description="Pareto front of the method in error and time")
    seconds: list[Positive] = Field(description="of the whole job, all pictures included; rising")
    rel_mse: list[Positive] = Field(description="falling")
    points: int = Field(description="measured points of the method that have a mean, on the front or not")
    gain: list[float | None] = Field(
        description="ratio of the error at this time to the error at twice the time; interpolated linearly on "
        "logarithmic axes, of path tracing from the fitted line; null where twice the time was not measured, where the "
        "interval spans more than a factor of two, and where it is more than stratified samples can gain"
    )
    gain_ci95: list[tuple[float, float] | None] = Field(
        description="95 % confidence interval of each gain, from those of the errors and from the scatter of the times"
    )


@dataclass(frozen=True)
class Gain:
    """Ratio of the error at a time to the error at twice the time.

    Attributes
    ----------
    value : float
    error : float
        Standard error of its logarithm, or half the interval over `_Z`.
    """

    value: float
    error: float

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % confidence interval."""
        reach = math.exp(_Z * self.error)
        return self.value / reach, self.value * reach

    @property
    def is_measured(self) -> bool:
        """Whether the interval is narrow enough for a statement; see `WIDEST`."""
        return 2 * _Z * self.error <= math.log(WIDEST)


@dataclass(frozen=True)
class MeanPoint:
    """Geometric means over the scenes of time and error, with the standard errors of their logarithms."""

    seconds: float
    rel_mse: float
    seconds_error: float = 0.0
    rel_mse_error: float = 0.0


def doubling_of(scenes: Sequence[SceneRecord], frames: int) -> list[DoublingRecord]:
    """Compute the gain of twice the time for path tracing and for the front of each method.

    Parameters
    ----------
    scenes : sequence of SceneRecord
        With the same points each. A point whose error is not positive in some scene is left out: it has no mean.
    frames : int
        Pictures of the job.
    """
    methods = dict.fromkeys(point.method for point in scenes[0].points)
    rows = {PATH_TRACING: _path_tracing(scenes, frames)} | {name: _method(scenes, name, frames) for name in methods}
    return [_record(name, points) for name, points in rows.items() if points]


def gains(points: Sequence[MeanPoint]) -> list[Gain | None]:
    """Ratio of the error at each point to the error at twice its time.

    Parameters
    ----------
    points : sequence of MeanPoint
        With rising times.

    Returns
    -------
    list of Gain or None
        None where the last point lies before twice the time.
    """
    t, e = (np.log([getattr(point, name) for point in points]) for name in ("seconds", "rel_mse"))
    t_error, e_error = (np.array([getattr(p, f"{name}_error") for p in points]) for name in ("seconds", "rel_mse"))
    found: list[Gain | None] = []
    for i, now in enumerate(t):
        then = now + np.log(2)
        if then > t[-1] + 1e-9:
            found.append(None)
            continue
        j = min(int(np.searchsorted(t, then, side="right")) - 1, len(t) - 2)
        step = t[j + 1] - t[j]
        share, slope = (then - t[j]) / step, (e[j + 1] - e[j]) / step
        # ---- Derivatives of e_i − [(1 − share) e_j + share e_{j+1}] by the errors and by the times ----
        by_error, by_time = np.zeros(len(t)), np.zeros(len(t))
        by_error[i] += 1
        by_error[j] -= 1 - share
        by_error[j + 1] -= share
        by_time[i] -= slope
        by_time[j] += slope * (1 - share)
        by_time[j + 1] += slope * share
        spread = float(np.hypot(np.linalg.norm(by_error * e_error), np.linalg.norm(by_time * t_error)))
        found.append(Gain(float(np.exp(by_error @ e)), spread))
    return found


def _path_tracing(scenes: Sequence[SceneRecord], frames: int) -> dict[str, MeanPoint]:
    return _means(
        {
            f"{p.samples} samples": MeanPoint(
                frames * p.seconds.median, p.error.rel_mse.value, p.seconds.relative_error, _relative(p.error.rel_mse)
            )
            for p in scene.path_tracing
        }
        for scene in scenes
    )


def _method(scenes: Sequence[SceneRecord], method: str, frames: int) -> dict[str, MeanPoint]:
    return _means(
        {
            p.label: MeanPoint(p.job_seconds(frames), p.rel_mse, _job_error(p, frames), _relative(p.error.rel_mse))
            for p in scene.points
            if p.method == method
        }
        for scene in scenes
    )


def _job_error(point: PointRecord, frames: int) -> float:
    """Relative standard error of the time of the whole job."""
    frame, baked = point.frame_seconds, point.bake.views_seconds
    absolute = math.hypot(frames * frame.median * frame.relative_error, baked.median * baked.relative_error)
    return absolute / max(point.job_seconds(frames), 1e-30)


def _relative(estimate: EstimateModel) -> float:
    """Relative standard error of an estimate, from its 95 % interval."""
    low, high = estimate.ci95
    return (high - low) / (2 * _Z) / max(abs(estimate.value), 1e-30)


def _means(by_scene: Iterable[Mapping[str, MeanPoint]]) -> dict[str, MeanPoint]:
    """Geometric mean over the scenes of time and error, by label."""
    rows = list(by_scene)
    found = {}
    for label in rows[0]:
        points = [row[label] for row in rows if label in row]
        values = np.array([(point.seconds, point.rel_mse) for point in points])
        if len(values) == len(rows) and (values > 0).all():
            errors = np.array([(point.seconds_error, point.rel_mse_error) for point in points])
            found[label] = MeanPoint(
                *np.exp(np.log(values).mean(axis=0)).tolist(), *(np.linalg.norm(errors, axis=0) / len(rows)).tolist()
            )
    return found


def _of_noise(points: Sequence[MeanPoint]) -> Gain | None:
    """Gain of path tracing from its fitted power law, the same at every time; None if that is beyond its rate."""
    if len(points) < LEAST_POINTS:
        return None
    law = fit_power_law([point.seconds for point in points], [point.rel_mse for point in points])
    gain = Gain(2.0**-law.slope, math.log(2) * (law.ci95[1] - law.ci95[0]) / (2 * _Z))
    return gain if gain.value <= MOST_OF_NOISE else None


def _record(name: str, points: Mapping[str, MeanPoint]) -> DoublingRecord:
    labels, means = list(points), list(points.values())
    on = front_of([point.seconds for point in means], [point.rel_mse for point in means]).on
    front = [means[index] for index in on]
    found = [_of_noise(means)] * len(on) if name == PATH_TRACING else gains(front)
    told = [gain if gain is not None and gain.is_measured else None for gain in found]
    return DoublingRecord(
        method=name,
        labels=[labels[index] for index in on],
        seconds=[point.seconds for point in front],
        rel_mse=[point.rel_mse for point in front],
        points=len(means),
        gain=[None if gain is None else gain.value for gain in told],
        gain_ci95=[None if gain is None else gain.ci95 for gain in told],
    )

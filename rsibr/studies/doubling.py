"""Gain of twice the time: by how much it divides the error, for each method and time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from pydantic import Field

from rsibr.studies.convergence import LEAST_POINTS, fit_power_law
from rsibr.studies.fronts import front_of
from rsibr.studies.results import Positive, Record, SceneRecord

PATH_TRACING = "path tracing"


class DoublingRecord(Record):
    """Least error of a method over the time of the whole job; geometric means over all scenes."""

    method: str
    labels: list[str] = Field(description="Pareto front of the method in error and time")
    seconds: list[Positive] = Field(description="of the whole job, all pictures included; rising")
    rel_mse: list[Positive] = Field(description="falling")
    gain: list[float | None] = Field(
        description="ratio of the error at this time to the error at twice the time; interpolated linearly on "
        "logarithmic axes, of path tracing from the fitted line; null where twice the time was not measured"
    )


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


def gains(seconds: Sequence[float], errors: Sequence[float]) -> list[float | None]:
    """Ratio of the error at each point to the error at twice its time.

    Parameters
    ----------
    seconds, errors : sequence of float
        Positive; the seconds rising.

    Returns
    -------
    list of float or None
        None where the last point lies before twice the time.
    """
    log_seconds, log_errors = np.log(seconds), np.log(errors)
    later = np.interp(log_seconds + np.log(2), log_seconds, log_errors)
    inside = 2 * np.asarray(seconds) <= seconds[-1] * (1 + 1e-9)
    return [
        float(np.exp(now - then)) if known else None for now, then, known in zip(log_errors, later, inside, strict=True)
    ]


def _path_tracing(scenes: Sequence[SceneRecord], frames: int) -> dict[str, tuple[float, float]]:
    return _means(
        {f"{p.samples} samples": (frames * p.seconds.median, p.error.rel_mse.value) for p in scene.path_tracing}
        for scene in scenes
    )


def _method(scenes: Sequence[SceneRecord], method: str, frames: int) -> dict[str, tuple[float, float]]:
    return _means(
        {p.label: (p.job_seconds(frames), p.rel_mse) for p in scene.points if p.method == method} for scene in scenes
    )


def _means(by_scene: Iterable[Mapping[str, tuple[float, float]]]) -> dict[str, tuple[float, float]]:
    """Geometric mean over the scenes of time and error, by label."""
    rows = list(by_scene)
    found = {}
    for label in rows[0]:
        values = np.array([row[label] for row in rows if label in row])
        if len(values) == len(rows) and (values > 0).all():
            seconds, error = np.exp(np.log(values).mean(axis=0)).tolist()
            found[label] = (seconds, error)
    return found


def _of_noise(seconds: Sequence[float], errors: Sequence[float]) -> list[float | None]:
    """Gain of path tracing from its fitted power law, also outside the measured range."""
    if len(seconds) < LEAST_POINTS:
        return gains(seconds, errors)
    return [2.0 ** -fit_power_law(seconds, errors).slope] * len(seconds)


def _record(name: str, points: Mapping[str, tuple[float, float]]) -> DoublingRecord:
    labels, pairs = list(points), list(points.values())
    on = front_of([seconds for seconds, _ in pairs], [error for _, error in pairs]).on
    seconds, errors = [pairs[index][0] for index in on], [pairs[index][1] for index in on]
    return DoublingRecord(
        method=name,
        labels=[labels[index] for index in on],
        seconds=seconds,
        rel_mse=errors,
        gain=_of_noise(seconds, errors) if name == PATH_TRACING else gains(seconds, errors),
    )

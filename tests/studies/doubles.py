"""Points with known errors and costs, and a tiny real study."""

from __future__ import annotations

from typing import Any

from rsibr.studies.results import (
    BakeRecord,
    ErrorRecord,
    PathTracingRecord,
    PlaceRecord,
    PointRecord,
    ReferenceRecord,
    SceneRecord,
    Timing,
    label_of,
)
from rsibr.validation.report.document import EstimateModel

MEGABYTE = 2**20

ZONES = {"inner": 4 / 9, "middle": 0.81 - 4 / 9, "rim": 0.19}
"""Shares of a disk by area."""


def estimate(value: float, half: float = 0.0) -> EstimateModel:
    return EstimateModel(value=value, ci95=(value - half, value + half), below_noise_floor=value - half <= 0 < half)


def error(value: float) -> ErrorRecord:
    """An error that is four times as large at the rim as inside."""
    zones = {"inner": estimate(value / 2), "middle": estimate(value), "rim": estimate(2 * value)}
    return ErrorRecord(
        rel_mse=estimate(value, abs(value) / 50),
        rel_mse_range=(value, value),
        rel_mse_zones=zones,
        smape=0.01,
        flip=0.02,
        energy_ratio=None,
        worst_texel=1.0,
        worst_place=PlaceRecord(view=1, s=0.9, t=0.5),
    )


def timing(seconds: float) -> Timing:
    return Timing(median=seconds, low=0.98 * seconds, high=1.04 * seconds, runs=5)


def point(
    rel_mse: float,
    bake_seconds: float,
    *,
    method: str = "rsibr",
    samples: int = 64,
    views: int = 12,
    noise: float = 0.0,
    frame_seconds: float = 0.001,
    size: int = MEGABYTE,
    setup_seconds: float = 0.0,
    prepare_seconds: float = 0.0,
    compile_seconds: float = 0.0,
    eval_rel_mse: float | None = None,
) -> PointRecord:
    """A point; `bake_seconds` is the rendering time of the bake's views."""
    baked = BakeRecord(
        samples=samples,
        resolution=64,
        subdivision=0,
        views=views,
        seconds=timing(bake_seconds).plus(setup_seconds),
        views_seconds=timing(bake_seconds),
        setup_seconds=setup_seconds,
        compile_seconds=setup_seconds / 2,
        disk_bytes=3 * MEGABYTE,
    )
    return PointRecord(
        label=label_of(method, views, 64, samples),
        method=method,
        warp="texel",
        weights="gnomonic",
        precision="float32",
        bake=baked,
        error=error(rel_mse),
        noise=noise,
        bias=estimate(rel_mse - noise),
        lobes={"diffuse": estimate(rel_mse / 4), "glossy-0.1": estimate(rel_mse / 2)} if method == "rsibr" else None,
        eval_rel_mse=None if eval_rel_mse is None else estimate(eval_rel_mse),
        eval_seconds=None if eval_rel_mse is None else timing(1e-7),
        prepare_seconds=prepare_seconds,
        compile_seconds=compile_seconds,
        frame_seconds=timing(frame_seconds),
        bytes=size,
    )


def path_traced(samples: int, *, pass_samples: int | None = None, noise: float = 1.0) -> PathTracingRecord:
    """Error noise/samples in samples milliseconds: relMSE = noise/1000 / seconds."""
    found = error(noise / samples)
    return PathTracingRecord(samples=samples, pass_samples=pass_samples, error=found, seconds=timing(samples * 1e-3))


def scene(points: list[PointRecord], **changes: Any) -> SceneRecord:
    values = {
        "material": "red <paint>",
        "material_class": "paint",
        "environment": "city",
        "reference": ReferenceRecord(
            samples=4096, buffers=8, sampler="multijitter", seconds=9.0, noise_floor=1e-5, zones=ZONES
        ),
        "path_tracing": [path_traced(n) for n in (64, 256, 1024)],
        "progressive": [path_traced(n, pass_samples=64) for n in (64, 256, 1024)],
        "points": points,
    }
    return SceneRecord(**{**values, **changes})


def converging(bias: float, noise: float, *, method: str = "rsibr", counts: tuple[int, ...] = (16, 64, 256, 1024)):
    """A curve of known bias and noise; a bake takes 0.1 s and a millisecond a sample."""
    return [
        point(bias + noise / n, 0.1 + 1e-3 * n, method=method, samples=n, noise=noise / n, size=MEGABYTE)
        for n in counts
    ]

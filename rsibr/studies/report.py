"""Writes a study: `study.json`, `study.csv` and, last, the page that shows both."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rsibr.store.atomic import write_atomic
from rsibr.store.csv_table import csv_table
from rsibr.studies.document import StudyDocument
from rsibr.studies.page import Drawn, study_page
from rsibr.studies.results import ErrorRecord, PointRecord, SceneRecord

PAGE_NAME, JSON_NAME, CSV_NAME = "study.html", "study.json", "study.csv"

COLUMNS = (
    "material",
    "environment",
    "class",
    "method",
    "warp",
    "weights",
    "precision",
    "views",
    "resolution",
    "samples",
    "rel_mse",
    "rel_mse_low",
    "rel_mse_high",
    "rel_mse_inner",
    "rel_mse_middle",
    "rel_mse_rim",
    "noise",
    "bias",
    "worst_lobe",
    "smape",
    "flip",
    "energy_ratio",
    "worst_texel",
    "worst_view",
    "worst_s",
    "worst_t",
    "bake_seconds",
    "bake_seconds_low",
    "bake_seconds_high",
    "views_seconds",
    "setup_seconds",
    "prepare_seconds",
    "compile_seconds",
    "once_seconds",
    "job_seconds",
    "frame_seconds",
    "frame_seconds_low",
    "frame_seconds_high",
    "eval_rel_mse",
    "eval_rel_mse_low",
    "eval_rel_mse_high",
    "eval_seconds",
    "bytes",
    "disk_bytes",
)
"""Columns of `study.csv`; empty where a value does not exist. `job_seconds` is for the pictures of `judge.frames`."""


def write_study(document: StudyDocument, folder: Path, drawn: Drawn) -> Path:
    """Write the study; each file is replaced atomically, the page last.

    Parameters
    ----------
    document : StudyDocument
    folder : Path
        Must exist.
    drawn : Drawn
        Figures of the page.

    Returns
    -------
    Path
        The page.
    """
    write_atomic(folder / JSON_NAME, document.to_json().encode())
    write_atomic(folder / CSV_NAME, study_table(document).encode())
    write_atomic(folder / PAGE_NAME, study_page(document, drawn).encode())
    return folder / PAGE_NAME


def study_table(document: StudyDocument) -> str:
    """Text of `study.csv`: a row a point."""
    return csv_table(COLUMNS, (row for scene in document.scenes for row in _rows(scene, document.judge.frames)))


def _rows(scene: SceneRecord, frames: int) -> Iterator[dict[str, Any]]:
    place = {"material": scene.material, "environment": scene.environment, "class": scene.material_class}
    for rival in (*scene.path_tracing, *scene.progressive):
        timing = rival.seconds
        times = {"frame_seconds": timing.median, "frame_seconds_low": timing.low, "frame_seconds_high": timing.high}
        method = "path tracing" if rival.pass_samples is None else f"path tracing, passes of {rival.pass_samples}"
        job = {"once_seconds": 0.0, "job_seconds": frames * timing.median}
        yield {**place, "method": method, "samples": rival.samples, **_error(rival.error), **times, **job}
    for point in scene.points:
        yield {**place, **_point(point, frames), **_error(point.error)}


def _error(error: ErrorRecord) -> dict[str, Any]:
    low, high = error.rel_mse.ci95
    return {
        "rel_mse": error.rel_mse.value,
        "rel_mse_low": low,
        "rel_mse_high": high,
        **{f"rel_mse_{zone}": estimate.value for zone, estimate in error.rel_mse_zones.items()},
        "smape": error.smape,
        "flip": error.flip,
        "energy_ratio": "" if error.energy_ratio is None else error.energy_ratio,
        "worst_texel": error.worst_texel,
        **{f"worst_{name}": value for name, value in error.worst_place},
    }


def _point(point: PointRecord, frames: int) -> dict[str, Any]:
    baked = point.bake
    own = ("method", "warp", "weights", "precision", "bytes", "prepare_seconds", "compile_seconds")
    return {
        **{name: getattr(point, name) for name in (*own, "once_seconds")},
        **{name: getattr(baked, name) for name in ("views", "resolution", "samples", "setup_seconds", "disk_bytes")},
        "noise": "" if point.noise is None else point.noise,
        "bias": "" if point.bias is None else point.bias.value,
        "worst_lobe": point.worst_lobe or "",
        "bake_seconds": baked.seconds.median,
        "bake_seconds_low": baked.seconds.low,
        "bake_seconds_high": baked.seconds.high,
        "views_seconds": baked.views_seconds.median,
        "job_seconds": point.job_seconds(frames),
        "frame_seconds": point.frame_seconds.median,
        "frame_seconds_low": point.frame_seconds.low,
        "frame_seconds_high": point.frame_seconds.high,
        **_eval(point),
    }


def _eval(point: PointRecord) -> dict[str, Any]:
    if point.eval_rel_mse is None or point.eval_seconds is None:
        return {}
    low, high = point.eval_rel_mse.ci95
    return {
        "eval_rel_mse": point.eval_rel_mse.value,
        "eval_rel_mse_low": low,
        "eval_rel_mse_high": high,
        "eval_seconds": point.eval_seconds.median,
    }

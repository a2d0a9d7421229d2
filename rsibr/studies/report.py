"""Writes a study: `study.json`, `study.csv` and, last, the page that shows both."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rsibr.store.atomic import write_atomic
from rsibr.studies.document import StudyDocument
from rsibr.studies.page import study_page
from rsibr.studies.results import ErrorRecord, PointRecord, SceneRecord

PAGE_NAME, JSON_NAME, CSV_NAME = "study.html", "study.json", "study.csv"

COLUMNS = (
    "material",
    "environment",
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
    "bake_seconds",
    "bake_seconds_low",
    "bake_seconds_high",
    "compile_seconds",
    "frame_seconds",
    "frame_seconds_low",
    "frame_seconds_high",
    "bytes",
    "disk_bytes",
)
"""Columns of `study.csv`; empty where a value does not exist, as the bake's where a picture was path traced."""


def write_study(document: StudyDocument, folder: Path) -> Path:
    """Write the study; each file is replaced at once, the page last.

    Parameters
    ----------
    document : StudyDocument
    folder : Path
        Must exist.

    Returns
    -------
    Path
        The page.
    """
    write_atomic(folder / JSON_NAME, document.to_json().encode())
    write_atomic(folder / CSV_NAME, _table(document).encode())
    write_atomic(folder / PAGE_NAME, study_page(document).encode())
    return folder / PAGE_NAME


def _table(document: StudyDocument) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    for scene in document.scenes:
        writer.writerows(_rows(scene))
    return stream.getvalue()


def _rows(scene: SceneRecord) -> Iterator[dict[str, Any]]:
    place = {"material": scene.material, "environment": scene.environment}
    for rival in (*scene.path_tracing, *scene.progressive):
        timing = rival.seconds
        times = {"frame_seconds": timing.median, "frame_seconds_low": timing.low, "frame_seconds_high": timing.high}
        method = "path tracing" if rival.pass_samples is None else f"path tracing, passes of {rival.pass_samples}"
        yield {**place, "method": method, "samples": rival.samples, **_error(rival.error), **times}
    for point in scene.points:
        yield {**place, **_point(point), **_error(point.error)}


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
    }


def _point(point: PointRecord) -> dict[str, Any]:
    baked = point.bake
    return {
        **{name: getattr(point, name) for name in ("method", "warp", "weights", "precision", "noise", "bytes")},
        **{name: getattr(baked, name) for name in ("views", "resolution", "samples", "compile_seconds", "disk_bytes")},
        "bias": point.bias.value,
        "worst_lobe": point.worst_lobe or "",
        "bake_seconds": baked.seconds.median,
        "bake_seconds_low": baked.seconds.low,
        "bake_seconds_high": baked.seconds.high,
        "frame_seconds": point.frame_seconds.median,
        "frame_seconds_low": point.frame_seconds.low,
        "frame_seconds_high": point.frame_seconds.high,
    }

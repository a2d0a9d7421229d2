"""Writes a comparison: `compare.json`, `compare.csv`, pictures and, last, the page that shows all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rsibr.store.atomic import write_atomic
from rsibr.store.csv_table import csv_table
from rsibr.studies.compare.document import CompareDocument
from rsibr.studies.compare.page import compare_page
from rsibr.studies.compare.pictures import ScenePictures
from rsibr.studies.compare.records import ComparedScene, SystemRecord
from rsibr.validation.report.report import write_pictures

PAGE_NAME, JSON_NAME, CSV_NAME = "compare.html", "compare.json", "compare.csv"
FILES = (JSON_NAME, CSV_NAME, PAGE_NAME)

COLUMNS = (
    "material",
    "environment",
    "class",
    "system",
    "setting",
    "views",
    "rel_mse",
    "rel_mse_low",
    "rel_mse_high",
    "smape",
    "flip",
    "energy_ratio",
    "worst_texel",
    "eval_rel_mse",
    "eval_rel_mse_low",
    "eval_rel_mse_high",
    "bake_seconds",
    "prepare_seconds",
    "compile_seconds",
    "once_seconds",
    "frame_seconds",
    "eval_prepare_seconds",
    "eval_seconds",
    "disk_bytes",
    "bytes",
    "eval_bytes",
    "refused",
)
"""Columns of `compare.csv`, a row a setting of a system on a scene; empty where a value does not exist."""


_PLAIN = (
    "bake_seconds",
    "prepare_seconds",
    "compile_seconds",
    "once_seconds",
    "eval_prepare_seconds",
    "disk_bytes",
    "bytes",
    "eval_bytes",
)


def write_comparison(document: CompareDocument, pictures: Sequence[ScenePictures], folder: Path) -> Path:
    """Write the comparison; each file is replaced atomically, the page last.

    Parameters
    ----------
    document : CompareDocument
    pictures : sequence of ScenePictures
        One a scene, in their order.
    folder : Path
        Must exist.

    Returns
    -------
    Path
        The page.
    """
    write_pictures(folder, "*.png", {name: picture for one in pictures for name, picture in one.named()})
    write_atomic(folder / JSON_NAME, document.to_json().encode())
    write_atomic(folder / CSV_NAME, compare_table(document).encode())
    write_atomic(folder / PAGE_NAME, compare_page(document, pictures).encode())
    return folder / PAGE_NAME


def compare_table(document: CompareDocument) -> str:
    """Text of `compare.csv`: a row a point."""
    return csv_table(COLUMNS, (row for scene in document.scenes for row in _rows(scene)))


def _rows(scene: ComparedScene) -> Iterator[dict[str, Any]]:
    place = {"material": scene.material, "environment": scene.environment, "class": scene.material_class}
    for record in scene.systems:
        yield {**place, **_error(record), **_cost(record)}
    for label, reason in scene.refused.items():
        yield {**place, "setting": label, "refused": reason}


def _error(record: SystemRecord) -> dict[str, Any]:
    error, points = record.error, record.eval_rel_mse
    low, high = error.rel_mse.ci95
    of_points = {} if points is None else {"eval_rel_mse": points.value} | _interval("eval_rel_mse", points.ci95)
    return {
        "system": record.system,
        "setting": record.label,
        "views": "" if record.views is None else record.views,
        "rel_mse": error.rel_mse.value,
        **_interval("rel_mse", (low, high)),
        "smape": error.smape,
        "flip": error.flip,
        "energy_ratio": "" if error.energy_ratio is None else error.energy_ratio,
        "worst_texel": error.worst_texel,
        **of_points,
    }


def _interval(name: str, ci95: tuple[float, float]) -> dict[str, float]:
    return {f"{name}_low": ci95[0], f"{name}_high": ci95[1]}


def _cost(record: SystemRecord) -> dict[str, Any]:
    cost = record.cost
    if cost is None:
        return {}
    medians = {name: getattr(cost, name).median for name in ("frame_seconds", "eval_seconds")}
    return {name: getattr(cost, name) for name in _PLAIN} | medians

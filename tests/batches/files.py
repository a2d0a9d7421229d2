"""A folder with skies and materials, and batches in it."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from rsibr.batches.config import BatchConfig, parse_batch
from rsibr.batches.matrix import Matrix
from tests.scene.maps import write_exr

BASE: dict[str, Any] = {
    "environment": {"emitter": {"type": "constant", "radiance": 0.5}},
    "material": {"preset": "matte-lambert"},
    "map": {"resolution": 8},
    "sampling": {"samples": 16},
}

MATERIAL = '<bsdf version="3.0.0" type="diffuse"><rgb name="reflectance" value="{}, 0.5, 0.5"/></bsdf>'


def write_folder(folder: Path) -> Path:
    """Write `skies/dawn.exr`, `skies/noon.exr`, `materials/chalk.xml` and `materials/slate.xml`."""
    for name in ("skies", "materials"):
        (folder / name).mkdir(parents=True)
    for name, radiance in (("dawn", 0.2), ("noon", 1.0)):
        write_exr(folder / "skies" / f"{name}.exr", np.full((4, 8, 3), radiance))
    for name, reflectance in (("chalk", 0.9), ("slate", 0.1)):
        (folder / "materials" / f"{name}.xml").write_text(MATERIAL.format(reflectance))
    return folder


def batch(folder: Path | str = ".", base: Mapping[str, Any] = BASE, **tables: Any) -> BatchConfig:
    """Batch with these tables over `BASE`."""
    return parse_batch({"base": deepcopy(base), **tables}, folder)


def names(folder: Path | str = ".", only: tuple[str, ...] = (), **tables: Any) -> list[str]:
    """Names of the jobs of a batch that has been checked."""
    matrix = Matrix.of(batch(folder, **tables), only=only)
    count, found = matrix.check(), [job.name for job in matrix.jobs()]
    assert count == len(found)
    return found

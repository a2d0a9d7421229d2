"""Comparisons with known errors and costs."""

from __future__ import annotations

from rsibr.studies.compare.records import ComparedScene, CostRecord, SystemRecord
from rsibr.studies.results import ReferenceRecord
from tests.studies.doubles import MEGABYTE, ZONES, error, estimate, timing


def cost(once: float = 1.0, size: int = MEGABYTE, frame: float = 0.001) -> CostRecord:
    """Cost whose time before the first map is half bake, half preparation."""
    return CostRecord(
        reads_maps=True,
        bake_seconds=once / 2,
        prepare_seconds=once / 2,
        compile_seconds=0.5,
        frame_seconds=timing(frame),
        eval_prepare_seconds=0.25,
        eval_seconds=timing(1e-7),
        disk_bytes=size // 2,
        bytes=size,
        eval_bytes=size,
    )


def record(label: str, rel_mse: float, costs: CostRecord | None, half: float | None = None) -> SystemRecord:
    """Record of a setting; its system is the label up to the first comma."""
    found = error(rel_mse)
    if half is not None:
        found = found.model_copy(update={"rel_mse": estimate(rel_mse, half)})
    return SystemRecord(
        label=label,
        system=label.partition(",")[0],
        options={},
        views=None,
        error=found,
        eval_rel_mse=None if costs is None else estimate(rel_mse),
        cost=costs,
    )


def scene(systems: list[SystemRecord], material: str = "paint", sky: str = "city", kind: str = "") -> ComparedScene:
    reference = ReferenceRecord(
        samples=4096, buffers=8, sampler="multijitter", seconds=9.0, noise_floor=1e-5, zones=ZONES
    )
    return ComparedScene(
        material=material,
        material_class=kind or material,
        environment=sky,
        folder=f"{material}-{sky}",
        resolution=64,
        views=[(0.0, 0.0, 1.0)],
        reference=reference,
        systems=systems,
        refused={},
    )

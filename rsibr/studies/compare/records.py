"""Records of a comparison's measurements: each system on each scene; the same in memory and in JSON."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from rsibr.studies.results import ErrorRecord, Positive, Record, ReferenceRecord, Timing
from rsibr.validation.report.estimate_document import EstimateModel


class CostRecord(Record):
    """Cost of one setting of a method. Times in seconds, sizes in bytes."""

    reads_maps: bool = Field(description="whether the method reads stored maps")
    bake_seconds: Positive = Field(
        description="of what the method reads: the whole bake, or, without stored maps, its set-up: loading, probes, "
        "lobe fits, light tables; nothing compiled"
    )
    prepare_seconds: Positive = Field(
        description="decoding, upload, prefiltering, tables, residuals, of the method by itself; nothing compiled"
    )
    compile_seconds: Positive = Field(
        description="compilation in all of these and the first map; the longest of all scenes. Which method compiles a "
        "kernel depends on the order, so that it is in no budget"
    )
    frame_seconds: Timing = Field(description="a map, nothing compiled")
    eval_prepare_seconds: Positive = Field(description="further preparation before the first point of eval")
    eval_seconds: Timing = Field(description="one evaluation of eval at a point")
    disk_bytes: int = Field(description="files that the method reads: maps and light, or the light alone")
    bytes: int = Field(description="arrays of the method on the device after its maps, shared ones included")
    eval_bytes: int = Field(description="the same after eval")

    @property
    def once_seconds(self) -> float:
        """Time before the first map: bake and preparation, nothing compiled."""
        return self.bake_seconds + self.prepare_seconds


class SystemRecord(Record):
    """One setting of a system on one scene."""

    label: str = Field(description="unique within the scene")
    system: str = Field(description="name of the method, or of the external maps")
    options: dict[str, Any] = Field(description="options in the method's name")
    views: int | None = Field(description="stored views that it reads; null without stored maps")
    error: ErrorRecord
    eval_rel_mse: EstimateModel | None = Field(
        description="relMSE of eval at random points of each texel, mean over the views; null for external maps"
    )
    cost: CostRecord | None = Field(description="null for external maps, whose cost is unknown")

    @property
    def rel_mse(self) -> float:
        """relMSE, mean over the views; an error below the noise floor counts as that."""
        return self.error.rel_mse.resolved


class ComparedScene(Record):
    """All systems on one material under one environment."""

    material: str
    material_class: str = Field(description="materials of one class are summed up together; by default the material")
    environment: str
    folder: str = Field(description="name of its folder in the folder of external maps")
    resolution: int = Field(description="texels a side of the compared maps")
    views: list[tuple[float, float, float]] = Field(description="unit vectors from the surface to the viewer, +Y up")
    reference: ReferenceRecord
    systems: list[SystemRecord]
    refused: dict[str, str] = Field(description="settings that the bake cannot serve, and why")

    @property
    def name(self) -> str:
        """Name to show."""
        return f"{self.material} under {self.environment}"

    def best(self) -> dict[str, SystemRecord]:
        """Setting with the least error of each system, in the order of the systems."""
        found = dict[str, SystemRecord]()
        for one in self.systems:
            if one.system not in found or one.rel_mse < found[one.system].rel_mse:
                found[one.system] = one
        return found

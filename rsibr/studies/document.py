"""The schema of `study.json`, and its writing: strict JSON, without NaN."""

from __future__ import annotations

import json
from typing import Literal

from pydantic import Field

from rsibr.studies.analysis import SceneAnalysis
from rsibr.studies.classes import ClassRecord
from rsibr.studies.doubling import DoublingRecord
from rsibr.studies.results import Positive, Record, SceneRecord


class JudgeRecord(Record):
    """How the error of all points was measured."""

    views: list[tuple[float, float, float]] = Field(description="unit vectors from the surface to the viewer, +Y up")
    resolution: int = Field(description="texels a side of the pictures that were compared")
    reference_samples: int = Field(description="samples a texel asked of each reference")
    repeats: int = Field(description="timed runs of each picture, after one that compiles")
    frames: int = Field(description="pictures of the whole job, beside bake, preparation and compilation")


class MachineRecord(Record):
    """Machine on which the times were measured."""

    variant: str
    processors: int
    system: str
    packages: dict[str, str]


class StepRecord(Record):
    """Expected and actual time of one step."""

    step: str
    expected_seconds: Positive
    seconds: Positive


class StudyDocument(Record):
    """`study.json`: error and cost of every point, and their analysis. Times in seconds, sizes in bytes."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str
    judge: JudgeRecord
    machine: MachineRecord
    expected_seconds: Positive = Field(description="forecast of this run, told before the first step; sum of the steps")
    seconds: Positive = Field(description="wall time of this run; a resumed run counts its own part")
    steps: list[StepRecord] = Field(description="of this run: preparation with start-up, every step, the page")
    scenes: list[SceneRecord]
    classes: list[ClassRecord] = Field(
        description="by class of material, what each method gains over the baseline; the worst class of a method first"
    )
    analyses: list[SceneAnalysis] = Field(description="one a scene, in their order; empty where only errors are judged")
    doubling: list[DoublingRecord] = Field(
        description="path tracing, then each method: mean over the scenes; empty where only errors are judged"
    )

    @property
    def analysed(self) -> list[tuple[SceneRecord, SceneAnalysis]]:
        """Each scene with its analysis; empty where only errors are judged."""
        return list(zip(self.scenes, self.analyses, strict=True)) if self.analyses else []

    def to_json(self) -> str:
        """Return strict JSON, indented."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def study_schema() -> str:
    """JSON Schema of `study.json`, as `docs/study.schema.json` holds it."""
    schema = StudyDocument.model_json_schema(by_alias=True, mode="serialization")
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"

"""The schema of `compare.json`, and its writing: strict JSON, without NaN."""

from __future__ import annotations

import json
from typing import Literal

from pydantic import Field

from rsibr.studies.compare.budgets import ClassRecord
from rsibr.studies.compare.records import ComparedScene
from rsibr.studies.document import MachineRecord
from rsibr.studies.results import Positive, Record


class CompareDocument(Record):
    """`compare.json`: error and cost of every system on every scene, and which wins at which cost."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str
    machine: MachineRecord
    reference_samples: int = Field(description="samples a texel asked of each reference; the least, if configs differ")
    shown_view: int = Field(description="number of the view in scenes[].views whose maps are shown, from 0")
    seconds: Positive = Field(description="wall time of this run; a resumed run counts its own part")
    systems: list[str] = Field(description="names of methods and external maps, in display order")
    classes: list[ClassRecord] = Field(
        description="geometric means by class of material; all scenes first if there is more than one class"
    )
    scenes: list[ComparedScene]

    def to_json(self) -> str:
        """Return strict JSON, indented."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def compare_schema() -> str:
    """JSON Schema of `compare.json`, as `docs/compare.schema.json` holds it."""
    schema = CompareDocument.model_json_schema(by_alias=True, mode="serialization")
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"

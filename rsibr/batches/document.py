"""What `rsibr batch --json` prints: a forecast, and what became of the jobs."""

from __future__ import annotations

import json
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(ge=0)]


class Record(BaseModel):
    """Base of all records: immutable, without NaN, unknown fields are errors. Needs no Mitsuba, unlike a study's."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class KindRecord(Record):
    """Jobs that cost the same, and the cost of one of them."""

    material: str
    views: int = Field(description="maps of a bake, as planned")
    resolution: int = Field(description="texels a side")
    samples: int = Field(description="samples a texel")
    jobs: int
    processor_seconds: Positive = Field(description="of one job whose worker knows its material and its sky")
    bytes: int = Field(description="of one bake, without the light of its sky")


class ForecastRecord(Record):
    """Forecast of the jobs that are still to run."""

    jobs: int = Field(description="jobs that are still to run")
    already_done: int
    materials: int
    skies: int
    source: Literal["probes", "rates"] = Field(description="measured by small jobs, or typical of a server's core")
    processor_seconds: Positive
    seconds: Positive = Field(description="wall time on this machine")
    bytes: int
    files: int
    free_bytes: int = Field(description="free where the batch is written")
    executor: str
    workers: int
    threads: int = Field(description="of a worker")
    kinds: list[KindRecord]
    notes: list[str]


class FailedRecord(Record):
    """A job that failed."""

    name: str
    reason: str
    signal: str | None = Field(description="name of the signal that ended its process")
    exit_code: int | None
    command: str | None = Field(description="repeats this job alone; null if the batch is no file")


class BatchDocument(Record):
    """What `rsibr batch --json` prints. Times in seconds, sizes in bytes."""

    schema_version: Literal[1] = Field(alias="schema")
    batch: str = Field(description="title of the batch")
    out: str = Field(description="directory of the batch")
    state: Literal["forecast", "indexed", "done", "failed"]
    jobs: int = Field(description="selected jobs")
    already_done: int = Field(description="jobs that were done before and did not run")
    done: int = Field(description="jobs that are done now, those before included")
    failed: list[FailedRecord]
    forecast: ForecastRecord | None = Field(description="null where nothing was to run, or none was asked for")
    seconds: Positive
    processor_seconds: Positive = Field(description="of the jobs that ran, by their results")
    bytes: int = Field(description="of all bakes that are done")
    index: list[str] = Field(description="files of the index; empty for a shard, which writes none")
    gallery: str | None
    damaged: list[str] = Field(description="result files that could not be read; their jobs run again")

    def to_json(self) -> str:
        """Return strict JSON in one line."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), allow_nan=False)


def batch_schema() -> str:
    """JSON Schema of `rsibr batch --json`, as `docs/batch.schema.json` holds it."""
    schema = BatchDocument.model_json_schema(by_alias=True, mode="serialization")
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"

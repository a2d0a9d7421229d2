"""Schema of the output of `rsibr plan --json`."""

from __future__ import annotations

import json
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from rsibr.planning.plan import Plan
from rsibr.store.manifest import BudgetRecord, SamplingRecord


class PlanDocument(BaseModel):
    """Effects that a scene needs. Times in seconds, sizes in bytes, errors as relMSE; null: not measured."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    schema_version: Literal[1] = Field(alias="schema")
    missed: tuple[str, ...] = Field(description="effects that matter here and are left out")
    plan: Plan
    sampling: SamplingRecord | None = Field(None, description="sampling chosen for a target error or a time budget")
    budget: BudgetRecord | None = Field(None, description="parameters chosen for a budget of the whole bake")

    @classmethod
    def of(cls, plan: Plan, sampling: SamplingRecord | None = None, budget: BudgetRecord | None = None) -> PlanDocument:
        """Make the document of a plan, with the choices of a target error, a time or a budget."""
        missed = tuple(effect.name for effect in plan.missed)
        return cls(schema=1, missed=missed, plan=plan, sampling=sampling, budget=budget)

    def to_json(self) -> str:
        """Return strict JSON, indented."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def plan_schema() -> str:
    """JSON Schema of the document, as `docs/plan.schema.json` holds it."""
    schema = PlanDocument.model_json_schema(by_alias=True, mode="serialization")
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"

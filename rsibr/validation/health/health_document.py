"""Schema of `health.json`, which is also the output of `rsibr check --json` and a part of `metrics.json`."""

from __future__ import annotations

import json
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from rsibr.validation.health.health import CaptureHealth, Finding, Health

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(ge=0)]
Direction = tuple[float, float, float]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class PlaceModel(_Model):
    """A texel of a stored map."""

    view: int = Field(description="index of the stored view")
    row: int = Field(description="0 is the top")
    column: int
    s: Share = Field(description="to the right")
    t: Share = Field(description="upwards")
    normal: Direction = Field(description="surface normal in world coordinates")
    reflection: Direction = Field(description="mirror direction in world coordinates")
    value: float | None = Field(description="relative standard error or radiance, by kind; null: not finite")


class FindingModel(_Model):
    """All texels of one kind."""

    verdict: Literal["failed", "warning", "none"] = Field(description="severity; none if no texel is of this kind")
    meaning: str
    texels: int = Field(ge=0)
    views: int = Field(ge=0, description="views with such texels")
    places: list[PlaceModel] = Field(description="at most eight, the worst first")

    @classmethod
    def of(cls, finding: Finding) -> FindingModel:
        """Make the model of a finding."""
        places = [PlaceModel(**vars(place)) for place in finding.places]
        return cls(
            verdict=finding.verdict if finding.texels else "none",
            meaning=finding.meaning,
            texels=finding.texels,
            views=finding.views,
            places=places,
        )


class DriftModel(_Model):
    """A view whose mean radiance is inconsistent with the other views."""

    view: int
    channel: str
    ratio: float = Field(description="mean radiance over the prediction from the other views")
    p_value: Share = Field(description="two-sided p-value of this deviation")


class SuspectModel(_Model):
    """A map of a capture that does not fit the others."""

    view: int
    name: str = Field(description="its photograph")
    fault: Literal["orientation", "exposure", "pose", "content"]
    what: str
    value: float = Field(description="stops, degrees, or correlation with the others")


class CaptureModel(_Model):
    """Maps that were captured, or made by another renderer."""

    suspects: list[SuspectModel]
    judgement_note: str = Field(description="what could not be judged; empty if everything was")
    covered: Share = Field(description="share of the sphere of views that lies between stored ones")
    largest_circumradius_deg: Positive = Field(description="largest distance of such a view from all stored ones")
    seen: Share = Field(description="share of the texels that were seen")
    variance: str = Field(description="photographs, spread or given: where the variance comes from")
    notes: list[str]

    @classmethod
    def of(cls, capture: CaptureHealth) -> CaptureModel:
        """Make the model of what is said of a capture."""
        told = {key: value for key, value in vars(capture).items() if key != "judgement"}
        suspects = [SuspectModel(**vars(one)) for one in capture.judgement.suspects]
        return cls(**{**told, "notes": list(capture.notes)}, suspects=suspects, judgement_note=capture.judgement.note)


class HealthModel(_Model):
    """Numerical health of the maps. `trusted` is false if a texel is NaN, Inf or missing."""

    trusted: bool
    warnings: int = Field(ge=0, description="number of kinds of warnings")
    views: int
    texels: int = Field(description="texels inside the disk, all views")
    findings: dict[str, FindingModel]
    largest: float = Field(description="largest finite radiance")
    relative_error: Positive = Field(description="median relative standard error of the texels")
    drifts: list[DriftModel]
    above_light: list[int] = Field(description="views with a mean radiance above the environment's maximum")
    energy_note: str = Field(description="reason why drifts and above_light were not tested; empty if they were")
    near_singularity: Share | None = Field(
        description="share of a novel view's texels with a source of confidence below 0.1; null for the normal warp"
    )
    clamp: float | None = Field(description="sampling.clamp of the bake; clamped texels are too dark")

    capture: CaptureModel | None = Field(None, description="of maps that were captured; null for those rendered")

    @classmethod
    def of(cls, health: Health) -> HealthModel:
        """Make the model of a health assessment."""
        return cls(
            trusted=health.trusted,
            warnings=health.warnings,
            views=health.views,
            texels=health.texels,
            findings={kind: FindingModel.of(finding) for kind, finding in health.findings.items()},
            largest=health.largest,
            relative_error=health.relative_error,
            drifts=[DriftModel(**vars(drift)) for drift in health.drifts],
            above_light=list(health.above_light),
            energy_note=health.energy_note,
            near_singularity=health.near_singularity,
            clamp=health.clamp,
            capture=None if health.capture is None else CaptureModel.of(health.capture),
        )

    def to_json(self) -> str:
        """Return strict JSON, indented."""
        return json.dumps(self.model_dump(mode="json"), indent=2, allow_nan=False, ensure_ascii=False) + "\n"

"""Schema of `metrics.json`, and its serialisation as strict JSON without NaN."""

from __future__ import annotations

import json
from typing import Any, Literal

from pydantic import Field

from rsibr.planning.plan import Plan
from rsibr.validation.health.health_document import HealthModel
from rsibr.validation.report.estimate_document import EstimateModel, Interval, Positive, Share, StrictModel
from rsibr.validation.report.lobe_document import LobesModel, ViewLobesModel
from rsibr.validation.results import MethodResult, MethodSummary, Validation, ViewResult


class WorstTexelModel(StrictModel):
    """The texel with the largest relative squared error; s and t are its centre in the sphere map."""

    s: Share = Field(description="to the right")
    t: Share = Field(description="upwards")
    error: Positive


class MethodModel(StrictModel):
    """One method at one view."""

    rel_mse: EstimateModel
    rel_mse_channels: tuple[EstimateModel, EstimateModel, EstimateModel] = Field(description="red, green, blue")
    rel_mse_zones: dict[str, EstimateModel] = Field(description="inner r < 2/3, middle r < 0.9, rim beyond")
    smape: Share = Field(description="mean of |a−b|/(|a|+|b|)")
    flip: Share = Field(description="mean HDR-FLIP at the exposures given under reference")
    energy_ratio: float | None = Field(description="Σa/Σb; null if a channel is black in the reference only")
    worst_texel: WorstTexelModel
    seconds: Positive = Field(description="time of the whole map")
    eval_rel_mse: EstimateModel | None = Field(None, description="relMSE of eval at single points; null: not measured")
    eval_seconds: Positive | None = Field(None, description="time of one evaluation of eval; null: not measured")

    @classmethod
    def of(cls, result: MethodResult) -> MethodModel:
        """Make the model of a method's result."""
        error = result.error
        red, green, blue = (EstimateModel.of(channel) for channel in error.rel_mse_channels)
        return cls(
            rel_mse=EstimateModel.of(error.rel_mse),
            rel_mse_channels=(red, green, blue),
            rel_mse_zones={zone: EstimateModel.of(value) for zone, value in error.rel_mse_zones.items()},
            smape=error.smape,
            flip=error.flip,
            energy_ratio=error.energy_ratio,
            worst_texel=WorstTexelModel(**vars(error.worst_texel)),
            seconds=result.seconds,
            eval_rel_mse=None if result.eval is None else EstimateModel.of(result.eval.rel_mse),
            eval_seconds=None if result.eval is None else result.eval.seconds,
        )


class ViewModel(StrictModel):
    """All methods at one view."""

    view: tuple[float, float, float] = Field(description="unit vector from the surface to the viewer, +Y up")
    label: str = Field(description="origin of the view")
    noise_floor: Positive = Field(description="relMSE due to the noise of the reference; subtracted in rel_mse")
    reference_seconds: Positive
    methods: dict[str, MethodModel]
    lobes: ViewLobesModel | None = Field(description="errors of single lobes; null: not measured")

    @classmethod
    def of(cls, view: ViewResult) -> ViewModel:
        """Make the model of a view's results."""
        return cls(
            view=view.view,
            label=view.label,
            noise_floor=view.noise_floor,
            reference_seconds=view.reference.seconds,
            methods={name: MethodModel.of(result) for name, result in view.methods.items()},
            lobes=None if view.lobes is None else ViewLobesModel.of(view.lobes),
        )


class SummaryModel(StrictModel):
    """One method over all views: means, and ranges over the views."""

    rel_mse: EstimateModel
    rel_mse_range: Interval
    rel_mse_zones: dict[str, EstimateModel]
    smape: Share
    flip: Share
    energy_ratio: float | None
    worst_texel: Positive = Field(description="largest relative squared error of any texel of any view")
    seconds: Positive = Field(description="mean time of a map")
    seconds_range: Interval
    eval_rel_mse: EstimateModel | None = Field(None, description="relMSE of eval at single points; null: not measured")
    eval_seconds: Positive | None = Field(None, description="time of one evaluation of eval; null: not measured")
    prepare_seconds: Positive = Field(0.0, description="preparation: decode, upload, tables, residuals")
    compile_seconds: Positive = Field(0.0, description="extra time of the first map: tracing and compilation")
    bake_seconds: Positive = Field(0.0, description="bake, without the rendering of maps if the method reads none")
    bytes: int = Field(ge=0, description="size on disk of what the method reads: maps, light, or both")
    path_tracing_seconds: Positive = Field(description="time of a path-traced map of equal relMSE")
    break_even_views: int | None = Field(
        description="views from which bake and reconstruction take no more time than path tracing; null: never"
    )

    @classmethod
    def of(cls, summary: MethodSummary) -> SummaryModel:
        """Make the model of a method's summary."""
        values: dict[str, Any] = dict(vars(summary))
        values["rel_mse"] = EstimateModel.of(summary.rel_mse)
        values["eval_rel_mse"] = None if summary.eval_rel_mse is None else EstimateModel.of(summary.eval_rel_mse)
        values["rel_mse_zones"] = {zone: EstimateModel.of(e) for zone, e in summary.rel_mse_zones.items()}
        return cls(**values)


class BakeModel(StrictModel):
    """Contents and cost of the bake."""

    name: str
    material: str
    environment: str
    views: int
    resolution: int
    samples: int
    seconds: Positive
    bytes: int
    details: dict[str, str | int | float]


class FlipModel(StrictModel):
    """Exposures [stops] of HDR-FLIP, the same for all views and methods."""

    start: float
    stop: float
    count: int


class ReferenceModel(StrictModel):
    """The path-traced references of all views."""

    samples: int = Field(description="samples a texel, total of all buffers")
    buffers: int
    sampler: str
    seconds: Positive = Field(description="total rendering time of all views, without compilation")
    compile_seconds: Positive
    noise_floor: Positive = Field(description="mean over the views")
    flip_exposures: FlipModel


class MetricsDocument(StrictModel):
    """`metrics.json`: errors of each method against path-traced references, and costs. Times in seconds."""

    schema_version: Literal[1] = Field(alias="schema")
    bake: BakeModel
    reference: ReferenceModel
    views: list[ViewModel]
    summary: dict[str, SummaryModel]
    lobes: LobesModel | None = Field(description="errors of single lobes over all views; null: not measured")
    health: HealthModel | None = Field(description="numerical health of the bake; null: not assessed")
    plan: Plan | None = Field(description="effects that the bake simulated or left out; null in bakes without a plan")

    def to_json(self) -> str:
        """Return strict JSON, indented."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def metrics_document(validation: Validation) -> MetricsDocument:
    """Convert a validation to the schema of `metrics.json`.

    Parameters
    ----------
    validation : Validation
        Result of a validation.

    Returns
    -------
    MetricsDocument
        `to_json()` returns the text of the file.
    """
    references = [view.reference for view in validation.views]
    return MetricsDocument(
        schema=1,
        bake=BakeModel(**vars(validation.bake)),
        reference=ReferenceModel(
            samples=references[0].samples,
            buffers=len(references[0].buffers),
            sampler=references[0].sampler,
            seconds=sum(reference.seconds for reference in references),
            compile_seconds=sum(reference.compile_seconds for reference in references),
            noise_floor=sum(view.noise_floor for view in validation.views) / len(references),
            flip_exposures=FlipModel(**vars(validation.exposures)),
        ),
        views=[ViewModel.of(view) for view in validation.views],
        summary={name: SummaryModel.of(s) for name, s in validation.summary.items()},
        lobes=LobesModel.of(validation.lobes) if validation.lobes else None,
        health=None if validation.health is None else HealthModel.of(validation.health),
        plan=validation.plan,
    )


def metrics_schema() -> str:
    """JSON Schema of `metrics.json`, as `docs/metrics.schema.json` holds it."""
    schema = MetricsDocument.model_json_schema(by_alias=True, mode="serialization")
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"

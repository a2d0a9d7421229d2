"""Schema of the part of `metrics.json` about lobes."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from rsibr.methods.registry import default_method
from rsibr.validation.lobes import LobeError, LobeSummary, ViewLobes, summarise
from rsibr.validation.report.estimate_document import EstimateModel, Interval, Positive, StrictModel


class LobeErrorModel(StrictModel):
    """One lobe at one view."""

    rel_mse: EstimateModel = Field(description="squared error of the lobe over the denominator of the map's relMSE")
    light: float = Field(description="share of the lobe in the radiance of the map")

    @classmethod
    def of(cls, error: LobeError) -> LobeErrorModel:
        """Make the model of a lobe's error."""
        return cls(rel_mse=EstimateModel.of(error.rel_mse), light=error.light)


class ViewLobesModel(StrictModel):
    """All lobes at one view."""

    worst: str = Field(description="the lobe with the largest error")
    errors: dict[str, LobeErrorModel]

    @classmethod
    def of(cls, lobes: ViewLobes) -> ViewLobesModel:
        """Make the model of a view's lobes."""
        return cls(worst=lobes.worst, errors={name: LobeErrorModel.of(error) for name, error in lobes.errors.items()})


class LobeSummaryModel(StrictModel):
    """One lobe over all views: means, and ranges over the views."""

    rel_mse: EstimateModel
    rel_mse_range: Interval
    light: float
    worst_views: int = Field(ge=0, description="number of views at which this lobe has the largest error")
    title: str = Field("", description="what the lobe is, for readers")

    @classmethod
    def of(cls, summary: LobeSummary) -> LobeSummaryModel:
        """Make the model of a lobe's summary."""
        return cls(**{**vars(summary), "rel_mse": EstimateModel.of(summary.rel_mse)})


class LobesModel(StrictModel):
    """Errors of each lobe in the maps of a method, against lobe-resolved references by the integrator of the bake."""

    method: str
    samples: int = Field(description="samples a texel of a lobe-resolved reference, total of all buffers")
    buffers: int
    seconds: Positive = Field(description="time of the lobe-resolved references of all views, including compilation")
    summary: dict[str, LobeSummaryModel]

    @classmethod
    def of(cls, views: Sequence[ViewLobes]) -> LobesModel:
        """Make the model of the lobes of all views."""
        return cls(
            method=default_method(),
            samples=views[0].samples,
            buffers=views[0].buffers,
            seconds=sum(view.seconds for view in views),
            summary={name: LobeSummaryModel.of(summary) for name, summary in summarise(views).items()},
        )

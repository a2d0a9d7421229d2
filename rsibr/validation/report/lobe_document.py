"""The part of `metrics.json` about lobes."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from rsibr.methods.registry import default_method
from rsibr.validation.lobes import LobeError, LobeSummary, ViewLobes, summarise
from rsibr.validation.report.estimate_document import EstimateModel, Interval, Positive, StrictModel


class LobeErrorModel(StrictModel):
    """One lobe at one view."""

    rel_mse: EstimateModel = Field(description="squared error of the lobe over the denominator of the whole's relMSE")
    light: float = Field(description="share of the lobe in the light of the map")

    @classmethod
    def of(cls, error: LobeError) -> LobeErrorModel:
        """Take over a lobe's error."""
        return cls(rel_mse=EstimateModel.of(error.rel_mse), light=error.light)


class ViewLobesModel(StrictModel):
    """All lobes at one view."""

    worst: str = Field(description="the lobe with the largest error")
    errors: dict[str, LobeErrorModel]

    @classmethod
    def of(cls, lobes: ViewLobes) -> ViewLobesModel:
        """Take over a view's lobes."""
        return cls(worst=lobes.worst, errors={name: LobeErrorModel.of(error) for name, error in lobes.errors.items()})


class LobeSummaryModel(StrictModel):
    """One lobe over all views: means, with the range over the views beside them."""

    rel_mse: EstimateModel
    rel_mse_range: Interval
    light: float
    worst_views: int = Field(ge=0, description="views at which no lobe has a larger error")

    @classmethod
    def of(cls, summary: LobeSummary) -> LobeSummaryModel:
        """Take over a lobe's summary."""
        return cls(**{**vars(summary), "rel_mse": EstimateModel.of(summary.rel_mse)})


class LobesModel(StrictModel):
    """Each lobe's part in the maps of a method, against the bake's own integrator: no path tracer tells lobes apart."""

    method: str
    samples: int = Field(description="samples a texel of a lobe-resolved reference, all buffers together")
    buffers: int
    seconds: Positive = Field(description="time of the lobe-resolved references of all views, compiling included")
    summary: dict[str, LobeSummaryModel]

    @classmethod
    def of(cls, views: Sequence[ViewLobes]) -> LobesModel:
        """Take over the lobes of all views."""
        return cls(
            method=default_method(),
            samples=views[0].samples,
            buffers=views[0].buffers,
            seconds=sum(view.seconds for view in views),
            summary={name: LobeSummaryModel.of(summary) for name, summary in summarise(views).items()},
        )

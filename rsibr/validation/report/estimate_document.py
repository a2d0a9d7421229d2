"""What the parts of `metrics.json` share: strict models, and an estimate with its interval."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from rsibr.validation.estimate import Estimate

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(ge=0)]
Interval = tuple[float, float]


class StrictModel(BaseModel):
    """No unknown keys, no NaN, no change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class EstimateModel(StrictModel):
    """A debiased relMSE with its confidence interval of 95 %, from the noise of the reference."""

    value: float
    ci95: Interval
    below_noise_floor: bool = Field(description="the interval holds 0: the reference cannot tell this error from none")

    @classmethod
    def of(cls, estimate: Estimate) -> EstimateModel:
        """Take over an estimate."""
        return cls(value=estimate.value, ci95=estimate.ci95, below_noise_floor=estimate.below_noise_floor)

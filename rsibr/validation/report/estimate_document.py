"""Common models of the parts of `metrics.json`: strict base class, and an estimate with its interval."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from rsibr.validation.estimate import Estimate

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(ge=0)]
Interval = tuple[float, float]


class StrictModel(BaseModel):
    """Immutable model without unknown keys, NaN or Inf."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class EstimateModel(StrictModel):
    """A debiased relMSE with its 95 % confidence interval, due to the noise of the reference."""

    value: float
    ci95: Interval
    below_noise_floor: bool = Field(description="the interval contains 0: the error is not significant")

    @classmethod
    def of(cls, estimate: Estimate) -> EstimateModel:
        """Make the model of an estimate."""
        return cls(value=estimate.value, ci95=estimate.ci95, below_noise_floor=estimate.below_noise_floor)

    @property
    def half_interval(self) -> float:
        """Half of the 95 % confidence interval."""
        return (self.ci95[1] - self.ci95[0]) / 2

    @property
    def resolved(self) -> float:
        """The value, or half the interval where that is larger: an error below the noise floor counts as that."""
        return max(self.value, self.half_interval)

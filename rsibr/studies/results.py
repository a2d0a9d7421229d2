"""Records of a study's measurements: pictures, bakes, references; the same in memory, in the journal and in JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from rsibr.validation.estimate import Estimate, mean_estimate
from rsibr.validation.metrics import MapError
from rsibr.validation.report.estimate_document import EstimateModel

Positive = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class Record(BaseModel):
    """Base of all records: immutable, without NaN, unknown fields are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Timing(Record):
    """Repeated times in seconds, device finished, nothing compiled."""

    median: Positive
    low: Positive = Field(description="lower quartile")
    high: Positive = Field(description="upper quartile")
    runs: int = Field(ge=1)

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Timing:
        """Summarise the times of equal work."""
        low, median, high = (float(q) for q in np.quantile(np.asarray(seconds, np.float64), (0.25, 0.5, 0.75)))
        return cls(median=median, low=low, high=high, runs=len(seconds))

    @property
    def relative_error(self) -> float:
        """Standard error of the median over the median, from the quartiles, as of a normal distribution."""
        return 1.253 * (self.high - self.low) / 1.349 / math.sqrt(self.runs) / max(self.median, 1e-30)

    def times(self, count: int) -> Timing:
        """Time of `count` times the work."""
        return Timing(median=count * self.median, low=count * self.low, high=count * self.high, runs=self.runs)

    def plus(self, seconds: float) -> Timing:
        """Time of the work and of `seconds` of other work, which was measured once."""
        bounds = {name: getattr(self, name) + seconds for name in ("median", "low", "high")}
        return Timing(**bounds, runs=self.runs)


class PlaceRecord(Record):
    """A texel of one judged view."""

    view: int = Field(description="number of the view in judge.views, from 0")
    s: float = Field(description="centre in the map, to the right, 0 to 1")
    t: float = Field(description="the same, up")

    @property
    def radius(self) -> float:
        """Distance from the middle of the disk, whose radius is 1."""
        return math.hypot(2 * self.s - 1, 2 * self.t - 1)


class ErrorRecord(Record):
    """Error over all judged views; the noise of the reference is subtracted from relMSE."""

    rel_mse: EstimateModel = Field(description="mean over the views")
    rel_mse_range: tuple[float, float] = Field(description="least and largest of the views")
    rel_mse_zones: dict[str, EstimateModel] = Field(description="inner r < 2/3, middle r < 0.9, rim beyond")
    smape: Share
    flip: Share
    energy_ratio: float | None
    worst_texel: Positive = Field(description="largest relative squared error of any texel of any view")
    worst_place: PlaceRecord = Field(description="where that texel lies")

    @classmethod
    def of(cls, errors: Sequence[MapError]) -> ErrorRecord:
        """Mean over the views."""
        values = [error.rel_mse.value for error in errors]
        energy = [error.energy_ratio for error in errors if error.energy_ratio is not None]
        zones = {name for error in errors for name in error.rel_mse_zones}
        view, worst = max(enumerate(error.worst_texel for error in errors), key=lambda found: found[1].error)
        return cls(
            rel_mse=mean_model([error.rel_mse for error in errors]),
            rel_mse_range=(min(values), max(values)),
            rel_mse_zones={
                name: mean_model([error.rel_mse_zones[name] for error in errors if name in error.rel_mse_zones])
                for name in ("inner", "middle", "rim")
                if name in zones
            },
            smape=float(np.mean([error.smape for error in errors])),
            flip=float(np.mean([error.flip for error in errors])),
            energy_ratio=float(np.mean(energy)) if len(energy) == len(errors) else None,
            worst_texel=worst.error,
            worst_place=PlaceRecord(view=view, s=worst.s, t=worst.t),
        )


class BakeRecord(Record):
    """A bake and its cost."""

    samples: int
    resolution: int
    subdivision: int | None = Field(description="of the icosahedron; null for views of the user's own")
    views: int = Field(description="stored views")
    seconds: Timing = Field(description="the whole bake: views_seconds and setup_seconds")
    views_seconds: Timing = Field(description="rendering of all views, each counted with the time of the median view")
    setup_seconds: Positive = Field(
        description="the rest of the wall time: loading, probes, lobe fits, light tables, compilation, writing"
    )
    compile_seconds: Positive = Field(
        description="of it the first view's time beyond the median; the longest of all bakes"
    )
    disk_bytes: int = Field(description="all maps on disk, with their variance, compressed")

    def compiling(self, seconds: float) -> BakeRecord:
        """Return the same with another compilation time, which counts in the whole."""
        more = seconds - self.compile_seconds
        whole = {"seconds": self.seconds.plus(more), "setup_seconds": self.setup_seconds + more}
        return self.model_copy(update={**whole, "compile_seconds": seconds})


class PointRecord(Record):
    """One variant on one bake: error over all judged views, and every cost."""

    label: str = Field(description="unique within the scene")
    method: str
    warp: str
    weights: str
    precision: str
    bake: BakeRecord
    error: ErrorRecord
    noise: Positive | None = Field(
        description="part of relMSE from the noise of the maps, by their stored variance; null where not judged"
    )
    bias: EstimateModel | None = Field(
        description="the rest of relMSE, independent of the samples of the bake; null where not judged"
    )
    lobes: dict[str, EstimateModel] | None = Field(
        description="contribution of each lobe to relMSE, relative to the whole radiance; null for a single lobe, and "
        "where not judged"
    )
    eval_rel_mse: EstimateModel | None = Field(
        description="relMSE of eval at random points of each texel, mean over the views; null where not judged"
    )
    eval_seconds: Timing | None = Field(description="one evaluation of eval, a value a view; null where not judged")
    prepare_seconds: Positive = Field(
        description="before the first picture: decoding and upload of maps and light, tables, residuals"
    )
    compile_seconds: Positive = Field(
        description="first picture's time beyond the others: tracing, compilation; the longest of the same variant"
    )
    frame_seconds: Timing = Field(description="a picture, nothing compiled")
    bytes: int = Field(description="arrays of the method on the device after its pictures, shared ones included")

    @property
    def rel_mse(self) -> float:
        """relMSE, mean over the views."""
        return self.error.rel_mse.value

    @property
    def worst_lobe(self) -> str | None:
        """Name of the lobe with the largest error."""
        return max(self.lobes, key=lambda name: self.lobes[name].value) if self.lobes else None  # type: ignore[index]

    @property
    def curve(self) -> str:
        """Name shared by all points that differ only in samples."""
        return self.label.rpartition(", ")[0]

    @property
    def once_seconds(self) -> float:
        """Time before the first picture: bake, preparation and compilation."""
        return self.bake.seconds.median + self.prepare_seconds + self.compile_seconds

    def job_seconds(self, frames: int) -> float:
        """Time of a whole job: bake, preparation, compilation and `frames` pictures."""
        return self.once_seconds + frames * self.frame_seconds.median


class PathTracingRecord(Record):
    """Path-traced pictures; they share no random number with a reference."""

    samples: int
    pass_samples: int | None = Field(description="samples of a pass; null: all stratified among each other")
    error: ErrorRecord
    seconds: Timing = Field(description="a picture")


class ReferenceRecord(Record):
    """References of one scene."""

    samples: int
    buffers: int
    sampler: str
    seconds: Positive = Field(description="rendering time of all views together")
    noise_floor: Positive = Field(description="mean over the views of the relMSE of their own noise; taken out")
    zones: dict[str, Share] = Field(description="share of the judged texels in each of the zones of rel_mse_zones")


class SceneRecord(Record):
    """Everything measured of one material under one environment."""

    material: str
    material_class: str = Field(description="materials of one class are summed up together; by default the material")
    environment: str
    reference: ReferenceRecord
    path_tracing: list[PathTracingRecord] = Field(
        description="all samples of a picture stratified among each other; empty where not compared with"
    )
    progressive: list[PathTracingRecord] = Field(description="path tracing in passes that share no strata")
    points: list[PointRecord]

    @property
    def name(self) -> str:
        """Name to show."""
        return f"{self.material} under {self.environment}"


def mean_model(estimates: Sequence[Estimate]) -> EstimateModel:
    """Mean of one estimate a view."""
    return EstimateModel.of(mean_estimate(estimates))


def label_of(variant: object, views: int, resolution: int, samples: int) -> str:
    """Name of a point, the samples last: see `PointRecord.curve`."""
    return f"{variant}, {views} views, {resolution}², {samples} samples"

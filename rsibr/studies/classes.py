"""Errors by class of material: what each method gains over the baseline, and the pairs where it gains least."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from rsibr.methods.registry import baseline_method
from rsibr.studies.agenda import Variant, variant_as_is
from rsibr.studies.results import PlaceRecord, PointRecord, Positive, Record, SceneRecord
from rsibr.validation.report.estimate_document import EstimateModel

PARTS: dict[str, tuple[str, ...]] = {"inner": ("inner",), "outer": ("middle", "rim")}
"""Parts of the disk by the zones of `rsibr.validation.metrics.ZONES` in them: within 2/3 of its radius, and beyond."""

_LEAST = float(np.finfo(np.float32).tiny)


class GainRecord(Record):
    """relMSE of the baseline over that of the method; an error below its noise floor counts as the noise floor."""

    mean: Positive = Field(description="geometric mean over the pairs")
    least: Positive = Field(
        description="of the pair where it is least, among those that are told if any is; below 1 the method errs more"
    )
    untold: int = Field(description="pairs of which a gain is not told: an error is below its noise floor")


class PairRecord(Record):
    """A material under an environment, as a method shows it."""

    material: str
    environment: str
    gain: Positive
    rel_mse: float
    baseline_rel_mse: float
    zone: str = Field(description="of rel_mse_zones: the one that holds most of the error of the method")
    place: PlaceRecord = Field(description="texel with the largest relative squared error of the method")

    @property
    def name(self) -> str:
        """Name to show."""
        return f"{self.material} under {self.environment}"


class ClassRecord(Record):
    """A method on all pairs of the materials of one class and the environments."""

    material_class: str | None = Field(description="null: all classes together")
    method: str
    pairs: int
    gain: GainRecord
    gain_inner: GainRecord | None = Field(description="within 2/3 of the radius of the disk")
    gain_outer: GainRecord | None = Field(description="beyond it: middle and rim together")
    energy_ratio: float | None = Field(description="of the pair where it is farthest from 1")
    worst: PairRecord = Field(description="pair with the least gain, among those that are told if any is")


def classes_of(scenes: Sequence[SceneRecord]) -> list[ClassRecord]:
    """Compare each method with the baseline on the same bakes, class by class.

    Parameters
    ----------
    scenes : sequence of SceneRecord
        Only methods as they are count, without other warps, weights or precision.

    Returns
    -------
    list of ClassRecord
        By method, each from its worst class to its best, then all classes together. Empty without the baseline.
    """
    found = [pair for scene in scenes for pair in _pairs(scene)]
    records = []
    for method in dict.fromkeys(pair.point.method for pair in found):
        by_class: dict[str, list[_Pair]] = {}
        for pair in found:
            if pair.point.method == method:
                by_class.setdefault(pair.scene.material_class, []).append(pair)
        rows = [_record(name, pairs) for name, pairs in by_class.items()]
        records += sorted(rows, key=lambda row: row.gain.least)
        records.append(_record(None, [pair for pairs in by_class.values() for pair in pairs]))
    return records


@dataclass(frozen=True)
class _Gain:
    """Error of the baseline over that of the method, and whether both are above their noise floors."""

    value: float
    is_told: bool

    @classmethod
    def of(cls, baseline: EstimateModel, error: EstimateModel) -> _Gain:
        ratio = max(baseline.resolved, _LEAST) / max(error.resolved, _LEAST)
        return cls(ratio, not (baseline.below_noise_floor or error.below_noise_floor))


@dataclass(frozen=True, eq=False)
class _Pair:
    """A point and that of the baseline on the same bake."""

    scene: SceneRecord
    point: PointRecord
    baseline: PointRecord

    @property
    def gain(self) -> _Gain:
        return _Gain.of(self.baseline.error.rel_mse, self.point.error.rel_mse)

    def gain_in(self, part: str) -> _Gain | None:
        """Gain in a part of the disk; None if no judged texel lies in it."""
        theirs, ours = (self._error_in(point, PARTS[part]) for point in (self.baseline, self.point))
        return None if theirs is None or ours is None else _Gain.of(theirs, ours)

    def _error_in(self, point: PointRecord, zones: Sequence[str]) -> EstimateModel | None:
        """Error of some zones together; their texels are independent."""
        judged = [name for name in zones if name in point.error.rel_mse_zones]
        known = [(self.scene.reference.zones[name], point.error.rel_mse_zones[name]) for name in judged]
        total = sum(share for share, _ in known)
        if total == 0:
            return None
        value = sum(share * error.value for share, error in known) / total
        half = math.hypot(*(share * error.half_interval for share, error in known)) / total
        return EstimateModel(
            value=value, ci95=(value - half, value + half), below_noise_floor=value <= half and half > 0
        )

    @property
    def record(self) -> PairRecord:
        zones, shares = self.point.error.rel_mse_zones, self.scene.reference.zones
        return PairRecord(
            material=self.scene.material,
            environment=self.scene.environment,
            gain=self.gain.value,
            rel_mse=self.point.rel_mse,
            baseline_rel_mse=self.baseline.rel_mse,
            zone=max(zones, key=lambda name: shares[name] * zones[name].value),
            place=self.point.error.worst_place,
        )


def _pairs(scene: SceneRecord) -> Iterator[_Pair]:
    plain = [point for point in scene.points if _variant(point) == variant_as_is(point.method)]
    baselines = {_bake(point): point for point in plain if point.method == baseline_method()}
    for point in plain:
        baseline = baselines.get(_bake(point))
        if baseline is not None and point is not baseline:
            yield _Pair(scene, point, baseline)


def _variant(point: PointRecord) -> Variant:
    return Variant(point.method, point.warp, point.weights, point.precision)


def _bake(point: PointRecord) -> tuple[object, ...]:
    """What tells the bakes of a scene apart."""
    return (point.bake.subdivision, point.bake.views, point.bake.resolution, point.bake.samples)


def _record(name: str | None, pairs: Sequence[_Pair]) -> ClassRecord:
    energies = [pair.point.error.energy_ratio for pair in pairs if pair.point.error.energy_ratio is not None]
    told = [pair for pair in pairs if pair.gain.is_told] or pairs
    worst = min(told, key=lambda pair: pair.gain.value)
    return ClassRecord(
        material_class=name,
        method=worst.point.method,
        pairs=len(pairs),
        gain=_gains([pair.gain for pair in pairs]),
        gain_inner=_gains_in("inner", pairs),
        gain_outer=_gains_in("outer", pairs),
        energy_ratio=max(energies, key=lambda ratio: abs(math.log(max(ratio, _LEAST)))) if energies else None,
        worst=worst.record,
    )


def _gains_in(part: str, pairs: Sequence[_Pair]) -> GainRecord | None:
    gains = [gain for gain in (pair.gain_in(part) for pair in pairs) if gain is not None]
    return _gains(gains) if gains else None


def _gains(gains: Sequence[_Gain]) -> GainRecord:
    values, told = [gain.value for gain in gains], [gain.value for gain in gains if gain.is_told]
    mean = float(np.exp(np.mean(np.log(values))))
    return GainRecord(mean=mean, least=min(told or values), untold=len(values) - len(told))

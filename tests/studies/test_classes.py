"""Errors by class of material, from records with known errors."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rsibr.studies.classes import classes_of
from rsibr.studies.page import gains
from rsibr.studies.results import ErrorRecord, PlaceRecord, PointRecord
from rsibr.validation.metrics import compare
from tests.studies.doubles import ZONES, error, estimate, point, scene
from tests.validation.doubles import smooth_map
from tests.validation.test_metrics import EXPOSURES, exact

OUTER = ZONES["middle"] + ZONES["rim"]


def judged(method: str, whole: float, *, half: float = 0.0, **changes: Any) -> PointRecord:
    """A point with the given relMSE everywhere, and other fields of its error."""
    zones = {name: estimate(whole, half) for name in ZONES}
    found = error(whole).model_copy(update={"rel_mse": estimate(whole, half), "rel_mse_zones": zones, **changes})
    plain = point(whole, 1.0, method=method)
    return plain.model_copy(update={"error": found, "weights": "area" if method == "cabral1999" else "gnomonic"})


def pair(name: str, material_class: str, baseline: float, ours: float, **changes: Any):
    points = [judged("cabral1999", baseline), judged("rsibr", ours, **changes)]
    return scene(points, material=name, material_class=material_class)


def test_gains_are_geometric_means_and_the_least_the_worst_class_first():
    found = classes_of([pair("a", "glass", 0.9, 0.1), pair("b", "glass", 0.04, 0.01), pair("c", "wood", 0.02, 0.01)])
    assert [(row.material_class, row.pairs) for row in found] == [("wood", 1), ("glass", 2), (None, 3)]
    wood, glass, every = found
    assert {row.method for row in found} == {"rsibr"}
    assert (wood.gain.mean, wood.gain.least) == pytest.approx((2, 2))
    assert (glass.gain.mean, glass.gain.least) == pytest.approx((math.sqrt(9 * 4), 4))
    assert (every.gain.mean, every.gain.least) == pytest.approx(((9 * 4 * 2) ** (1 / 3), 2))
    assert (glass.worst.material, glass.worst.environment, glass.worst.gain) == ("b", "city", pytest.approx(4))
    assert (glass.worst.rel_mse, glass.worst.baseline_rel_mse) == (0.01, 0.04)
    assert every.worst == wood.worst


def test_the_outer_part_is_middle_and_rim_weighted_by_their_texels():
    zones = {"inner": estimate(0.5), "middle": estimate(0.02), "rim": estimate(0.08)}
    (row, _) = classes_of([pair("a", "glass", 0.1, 0.04, rel_mse_zones=zones)])
    outer = (ZONES["middle"] * 0.02 + ZONES["rim"] * 0.08) / OUTER
    assert row.gain_inner.least == pytest.approx(0.1 / 0.5)
    assert row.gain_outer.mean == pytest.approx(0.1 / outer)
    assert row.gain.mean == pytest.approx(0.1 / 0.04)


def test_a_part_without_texels_has_no_gain():
    points = [judged(name, 0.1, rel_mse_zones={"inner": estimate(0.1)}) for name in ("cabral1999", "rsibr")]
    (row, _) = classes_of([scene(points)])
    assert row.gain_inner.mean == 1
    assert row.gain_outer is None


def test_an_error_below_the_noise_floor_counts_as_the_noise_floor():
    (row, _) = classes_of([pair("a", "glass", 0.1, -0.001, half=0.005)])
    assert (row.gain.mean, row.gain.least, row.gain.untold) == pytest.approx((20, 20, 1))
    assert row.worst.rel_mse == -0.001
    outer = 0.005 * math.hypot(ZONES["middle"], ZONES["rim"]) / OUTER  # independent texels
    assert row.gain_outer.mean == pytest.approx(0.1 / outer)
    black = [judged(name, 0.0) for name in ("cabral1999", "rsibr")]
    assert classes_of([scene(black)])[0].gain.mean == 1


def test_a_gain_that_is_not_told_is_no_worst_one():
    """Beside one that is: it is a lower bound, and says nothing against the method."""
    pairs = [pair("noisy", "glass", 0.01, 0.001, half=0.005), pair("clean", "glass", 0.08, 0.01, half=0.001)]
    (row, _) = classes_of(pairs)
    assert (row.gain.mean, row.gain.least, row.gain.untold) == pytest.approx((math.sqrt(2 * 8), 8, 1))
    assert row.worst.material == "clean"
    assert gains(row.gain) == "≥ 4.0 · 8.0"
    assert gains(classes_of(pairs[1:])[0].gain) == "8.0 · 8.0"
    assert gains(None) == "–"


def test_the_worst_energy_ratio_is_the_farthest_from_one():
    ratios = (1.2, 0.75, 1.01, None)
    pairs = [pair(str(k), "glass", 0.1, 0.01, energy_ratio=ratio) for k, ratio in enumerate(ratios)]
    assert classes_of(pairs)[0].energy_ratio == 0.75
    assert classes_of(pairs[3:])[0].energy_ratio is None


def test_the_worst_pair_says_where_its_error_lies():
    """Of the zones the one with most of the error: its texels count, not only their mean."""
    zones = {"inner": estimate(0.05), "middle": estimate(0.01), "rim": estimate(0.1)}
    place = PlaceRecord(view=0, s=0.5, t=0.95)
    (row, _) = classes_of([pair("a", "glass", 0.1, 0.04, rel_mse_zones=zones, worst_place=place)])
    assert row.worst.zone == "inner"
    assert row.worst.place == place
    assert row.worst.place.radius == pytest.approx(0.9)


def test_each_bake_is_compared_with_the_baseline_on_itself():
    few = [judged("cabral1999", 0.4), judged("rsibr", 0.1)]
    many = [
        one.model_copy(update={"bake": one.bake.model_copy(update={"samples": 256})})
        for one in (judged("cabral1999", 0.2), judged("rsibr", 0.1), judged("rsibr-fine", 0.05))
    ]
    meshed = judged("rsibr", 0.3).model_copy(update={"warp": "mesh-4x12"})
    found = {row.method: row for row in classes_of([scene([*few, *many, meshed])]) if row.material_class is None}
    assert found["rsibr"].pairs == 2
    assert found["rsibr"].gain.mean == pytest.approx(math.sqrt(4 * 2))
    assert found["rsibr-fine"].gain.mean == pytest.approx(4)


def test_without_the_baseline_there_is_nothing_to_compare():
    assert classes_of([scene([judged("rsibr", 0.1)])]) == []
    assert classes_of([scene([judged("cabral1999", 0.1)])]) == []


def test_the_worst_texel_is_that_of_the_worst_view():
    reference = exact(smooth_map())
    errors = []
    for row, column, factor in ((3, 12, 1.5), (20, 9, 3.0), (16, 16, 2.0)):
        candidate = smooth_map()
        candidate[row, column] *= factor
        errors.append(compare(candidate, reference, EXPOSURES))
    found = ErrorRecord.of(errors)
    assert found.worst_place == PlaceRecord(view=1, s=9.5 / 32, t=1 - 20.5 / 32)
    assert found.worst_texel == errors[1].worst_texel.error

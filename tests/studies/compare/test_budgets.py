"""Which system wins from which budget on: by hand-made numbers."""

from __future__ import annotations

import math

import pytest

from rsibr.studies.compare.budgets import budget_table, candidate, classes_of, ladder, mean_candidates, winners
from rsibr.studies.compare.page import shown
from tests.studies.compare.doubles import cost, record, scene
from tests.studies.doubles import MEGABYTE


def candidates(*rows, half=0.0):
    """Candidates of label, error, time before the first map."""
    return [candidate(record(label, error, cost(once), half)) for label, error, once in rows]


def told(found):
    return [(one.label, one.budget) for one in found]


def test_the_winner_of_a_budget_is_the_least_error_within_it():
    found = winners(candidates(("a", 0.5, 1.0), ("b", 0.9, 2.0), ("c", 0.1, 4.0), ("d", 0.2, 8.0)), "once_seconds")
    assert told(found) == [("a", 1.0), ("c", 4.0)]


def test_each_cost_has_winners_of_its_own():
    rows = [record("a", 0.5, cost(1.0, 8 * MEGABYTE, 0.004)), record("b", 0.1, cost(9.0, MEGABYTE, 0.002))]
    both = [candidate(row) for row in rows]
    assert told(winners(both, "once_seconds")) == [("a", 1.0), ("b", 9.0)]
    assert told(winners(both, "bytes")) == [("b", MEGABYTE)]
    assert told(winners(both, "frame_seconds")) == [("b", 0.002)]


def test_a_dearer_system_takes_over_only_where_its_error_is_known_to_be_less():
    rows = candidates(("a", 0.100, 1.0), ("b", 0.095, 2.0), ("c", 0.05, 4.0), half=0.01)
    found = winners(rows, "once_seconds")
    assert told(found) == [("a", 1.0), ("c", 4.0)]
    assert [one.level_with for one in found] == [["b"], []]


def test_a_system_that_is_level_only_beyond_the_next_budget_is_not_named():
    rows = candidates(("a", 0.100, 1.0), ("c", 0.05, 4.0), ("b", 0.095, 5.0), half=0.01)
    assert [one.level_with for one in winners(rows, "once_seconds")] == [[], []]


def test_costs_that_differ_hardly_are_equal():
    """The lesser error wins, although the other was faster by less than times are known."""
    found = winners(candidates(("a", 0.5, 1.00), ("b", 0.1, 1.04), ("c", 0.05, 1.06)), "once_seconds")
    assert told(found) == [("b", 1.04), ("c", 1.06)]  # c exceeds a, the first of the group, by more


def test_the_table_shows_the_best_setting_of_each_system_within_each_budget():
    rows = candidates(("a, 12 views", 0.5, 1.5), ("a, 42 views", 0.2, 9.0), ("b", 0.3, 4.0))
    table = budget_table(rows, "once_seconds", "s")
    assert [row.budget for row in table] == [2.0, 5.0, 10.0]
    first, second, third = table
    assert {name: one.label for name, one in first.best.items()} == {"a": "a, 12 views"}
    assert {name: (one.rel_mse, one.is_least) for name, one in second.best.items()} == {
        "a": (0.5, False),
        "b": (0.3, True),
    }
    assert third.best["a"].label == "a, 42 views"
    assert third.best["a"].is_least


def test_nothing_measured_is_an_empty_table():
    assert budget_table([], "bytes", "B") == []
    assert winners([], "bytes") == []


@pytest.mark.parametrize("unit", ["s", "B"])
@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (0.06e-3, 30e-3), (3.0, 5000.0), (1e5, 3e10), (1024.0, 1024.0)])
def test_budgets_reach_from_the_cheapest_to_the_dearest(low, high, unit):
    rungs = ladder(low, high, unit)
    assert 1 <= len(rungs) <= 9
    assert rungs == sorted(rungs)
    assert rungs[0] >= low * (1 - 1e-9)
    assert rungs[-1] >= high * (1 - 1e-9)
    assert all(rung < high for rung in rungs[:-1])


def test_means_over_a_class_are_geometric():
    scenes = [
        scene([record("a", 0.1, cost(1.0), 0.01)], sky="city"),
        scene([record("a", 0.4, cost(4.0), 0.04)], sky="studio"),
    ]
    (mean,) = mean_candidates(scenes)
    assert mean.rel_mse == pytest.approx(0.2)
    assert mean.costs["once_seconds"] == pytest.approx(2.0)
    # two independent errors of 10 %: the mean of their logarithms has 10 % / √2
    assert mean.ci95[1] / mean.rel_mse == pytest.approx(math.exp(0.1 / math.sqrt(2)), rel=1e-6)


def test_an_error_below_the_noise_floor_counts_as_half_its_interval():
    (mean,) = mean_candidates([scene([record("a", -0.001, cost(), 0.004)])])
    assert mean.rel_mse == pytest.approx(0.004)


def test_a_setting_that_misses_a_scene_is_in_no_mean():
    scenes = [
        scene([record("a", 0.1, cost()), record("b", 0.1, cost())], sky="city"),
        scene([record("a", 0.1, cost())], sky="studio"),
    ]
    assert [one.label for one in mean_candidates(scenes)] == ["a"]


def test_classes_are_summed_up_apart_and_all_together_first():
    scenes = [
        scene([record("a", 0.5, cost(1.0)), record("b", 0.1, cost(8.0))], "tin", kind="metal"),
        scene([record("a", 0.01, cost(1.0)), record("b", 0.1, cost(8.0))], "chalk", kind="matte"),
    ]
    found = classes_of(scenes)
    assert [(one.name, one.scenes) for one in found] == [("all", 2), ("metal", 1), ("matte", 1)]
    assert [[one.system for one in record_.winners["once_seconds"]] for record_ in found[1:]] == [["a", "b"], ["a"]]
    assert [one.material_class for one in classes_of(scenes[:1])] == ["metal"]


def test_external_maps_have_no_cost_and_win_no_budget():
    (found,) = classes_of([scene([record("a", 0.5, cost(1.0)), record("theirs", 0.01, None)])])
    assert [one.system for one in found.means] == ["a", "theirs"]
    assert all("theirs" not in {one.system for one in rows} for rows in found.winners.values())


def test_an_error_below_the_noise_floor_is_an_upper_limit_everywhere():
    below, known = record("a", -1e-4, cost(), half=2e-4), record("a", 4e-4, cost(), half=1e-4)
    assert not candidate(known).is_bound
    assert candidate(below).is_bound
    assert candidate(below).rel_mse == pytest.approx(2e-4)
    (found,) = classes_of([scene([below]), scene([known], sky="sunset")])
    (mean,), (winner,) = found.means, found.winners["bytes"]
    assert shown(mean) == shown(winner) == "< 2.8 × 10⁻⁴"
    assert shown(classes_of([scene([known])])[0].means[0]) == "4.0 × 10⁻⁴"


def test_a_method_without_arrays_has_a_place_in_the_tables():
    rows = [candidate(record("a", 0.5, cost(size=0))), candidate(record("b", 0.1, cost(size=MEGABYTE)))]
    budgets = [row.budget for row in budget_table(rows, "bytes", "B")]
    assert budgets[0] >= 64
    assert budgets[-1] >= MEGABYTE
    assert len(set(budgets)) == len(budgets)

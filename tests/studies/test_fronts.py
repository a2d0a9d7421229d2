"""Pareto fronts against the definition, and what twice the time buys against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.studies.doubling import doubling_of, gains
from rsibr.studies.fronts import front_of
from tests.studies.doubles import converging, path_traced, point, scene


def test_a_front_by_hand():
    front = front_of(costs=[1, 2, 3, 4, 2], errors=[5, 3, 4, 1, 6])
    assert front.on == (0, 1, 3)
    assert front.dominated == {2: 1, 4: 1}  # of those that cost no more, the one with the least error


def test_of_equal_points_the_first_is_on_the_front():
    front = front_of([1, 1, 1], [2, 2, 2])
    assert front.on == (0,)
    assert front.dominated == {1: 0, 2: 0}


def test_all_points_of_a_falling_line_are_on_the_front():
    assert front_of([3, 2, 1], [1, 2, 3]).on == (2, 1, 0)
    assert front_of([3, 2, 1], [1, 2, 3]).dominated == {}


def test_a_front_is_what_nothing_beats(rng):
    costs, errors = rng.integers(0, 20, (2, 200)).tolist()
    front = front_of(costs, errors)

    def beats(a, b):
        return costs[a] <= costs[b] and errors[a] <= errors[b] and (costs[a], errors[a]) != (costs[b], errors[b])

    every = range(len(costs))
    assert set(front.on) | set(front.dominated) == set(every)
    assert not any(beats(a, b) for b in front.on for a in every)
    for index, by in front.dominated.items():
        assert by in front.on
        assert costs[by] <= costs[index]
        assert errors[by] <= errors[index]
    assert (np.diff([costs[i] for i in front.on]) > 0).all()
    assert (np.diff([errors[i] for i in front.on]) < 0).all()


def test_no_points_no_front():
    assert front_of([], []).on == ()


def test_twice_the_time_halves_a_power_of_minus_one_and_buys_nothing_on_a_flat_line():
    seconds = [1.0, 3.0, 9.0, 27.0]
    assert gains(seconds, [1 / t for t in seconds]) == pytest.approx([2, 2, 2, None])
    assert gains(seconds, [5.0] * 4) == pytest.approx([1, 1, 1, None])
    assert gains(seconds, [t**-0.5 for t in seconds])[0] == pytest.approx(np.sqrt(2))
    assert gains([1.0, 2.0], [4.0, 1.0]) == pytest.approx([4, None])
    assert gains([1.0], [1.0]) == [None]


def test_doubling_takes_the_mean_over_the_scenes_and_the_time_of_the_whole_job():
    dark, bright = (scene([point(e, 1.0, frame_seconds=0.01), point(e / 2, 4.0, samples=256)]) for e in (0.1, 0.4))
    records = {record.method: record for record in doubling_of([dark, bright], frames=100)}
    assert records["rsibr"].seconds == pytest.approx([1.0 + 100 * 0.01, 4.0 + 100 * 0.001])
    assert records["rsibr"].rel_mse == pytest.approx([0.2, 0.1])
    assert records["path tracing"].seconds == pytest.approx([6.4, 25.6, 102.4])
    assert records["path tracing"].gain == pytest.approx([2, 2, 2])


def test_doubling_leaves_out_what_another_point_of_the_method_beats():
    worse = point(0.3, 2.0, views=42)
    (_, record) = doubling_of([scene([point(0.2, 1.0), worse])], frames=1)
    assert record.labels == [point(0.2, 1.0).label]


def test_doubling_leaves_out_a_point_without_a_mean():
    records = doubling_of([scene([point(-1e-9, 1.0), point(0.2, 2.0, samples=16)])], frames=1)
    assert records[1].rel_mse == pytest.approx([0.2])
    lost = scene([point(-1e-9, 1.0)], path_tracing=[path_traced(n) for n in (4, 16, 64)])
    assert [record.method for record in doubling_of([lost], frames=1)] == ["path tracing"]


def test_the_gain_of_a_flattening_curve_falls_to_one():
    (_, record) = doubling_of([scene(converging(0.01, 1.0, counts=(4, 64, 1024, 16384, 262144)))], frames=1)
    known = [gain for gain in record.gain if gain is not None]
    assert known == sorted(known, reverse=True)
    assert known[-1] == pytest.approx(1.0, abs=0.01)

"""Pareto fronts against the definition, and what twice the time buys against closed forms."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rsibr.studies.doubling import MeanPoint, doubling_of, gains
from rsibr.studies.fronts import front_of
from rsibr.studies.page import answer
from tests.studies.doubles import converging, error, estimate, path_traced, point, scene


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


def line(seconds, errors, relative=0.0):
    """Points of a front whose errors and times have the same relative standard error."""
    return [MeanPoint(t, e, relative, relative) for t, e in zip(seconds, errors, strict=True)]


def values(found):
    return [None if gain is None else gain.value for gain in found]


def test_twice_the_time_halves_a_power_of_minus_one_and_buys_nothing_on_a_flat_line():
    seconds = [1.0, 3.0, 9.0, 27.0]
    assert values(gains(line(seconds, [1 / t for t in seconds]))) == pytest.approx([2, 2, 2, None])
    assert values(gains(line(seconds, [5.0] * 4))) == pytest.approx([1, 1, 1, None])
    assert values(gains(line(seconds, [t**-0.5 for t in seconds])))[0] == pytest.approx(np.sqrt(2))
    assert values(gains(line([1.0, 2.0], [4.0, 1.0]))) == pytest.approx([4, None])
    assert gains(line([1.0], [1.0])) == [None]


def test_the_interval_of_a_gain_covers_95_percent(rng):
    """Errors and times scattered as they say; 4000 trials, 4 σ: false-alarm rate 6e-5."""
    seconds, relative, inside = np.array([1.0, 3.0, 9.0]), 0.05, 0
    for _ in range(4000):
        e, t = (np.exp(relative * rng.normal(size=3)) for _ in range(2))
        gain = gains(line(seconds * t, e / seconds, relative))[0]
        inside += gain.ci95[0] <= 2 <= gain.ci95[1]
    assert abs(inside / 4000 - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 4000) + 0.005


def test_three_noisy_points_of_path_tracing_carry_no_gain():
    """What was once told of such points: "twice the time divides the error by 6.4"."""
    noisy = [path_traced(n, noise=noise) for n, noise in ((64, 3.0), (144, 0.5), (256, 0.2))]
    (record, *_) = doubling_of([scene([point(0.1, 1.0)], path_tracing=noisy)], frames=1)
    assert record.gain == record.gain_ci95 == [None] * 3
    assert answer([record], 1)[0].endswith("what twice the time buys is not measurable from 3 points.")


def test_a_gain_beyond_that_of_stratified_samples_is_not_told():
    steep = [path_traced(n, noise=1 / n**1.5) for n in (64, 128, 256, 512)]
    (record, *_) = doubling_of([scene([point(0.1, 1.0)], path_tracing=steep)], frames=1)
    assert record.gain == [None] * 4


def test_a_gain_comes_with_its_interval():
    (traced, own) = doubling_of([scene(converging(0.0, 1.0, counts=(64, 256, 1024)))], frames=1)
    assert traced.gain_ci95[0] == pytest.approx((2, 2))
    low, high = own.gain_ci95[0]
    assert low < own.gain[0] < high < 2 * low
    assert re.search(r"divides the error by \S+ \(\S+ to \S+\)", answer([own], 1)[0])


def test_a_gain_of_uncertain_errors_is_not_told():
    vague = [
        point(e, t, samples=n).model_copy(update={"error": error(e)}) for e, t, n in ((0.1, 1.0, 16), (0.05, 4.0, 64))
    ]
    vague = [
        one.model_copy(update={"error": one.error.model_copy(update={"rel_mse": estimate(one.rel_mse, one.rel_mse)})})
        for one in vague
    ]
    (_, record) = doubling_of([scene(vague)], frames=1)
    assert record.gain == [None, None]


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

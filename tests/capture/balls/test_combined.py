"""Several balls: bounds are never averaged in, and balls that disagree are told."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.capture.balls.combined import Shown, combined, disagreements


def shown(radiance, weight=1.0, saturated=False):
    values = np.broadcast_to(np.asarray(radiance, float), (1, 1, 3))
    return Shown(values, np.full((1, 1), weight), np.full((1, 1), saturated))


@pytest.mark.parametrize(
    ("balls", "expected", "is_bound"),
    [
        ([shown(2, 3), shown(6, 1)], 3, False),
        ([shown(2, 3), shown(6, 0)], 2, False),
        ([shown(10, saturated=True), shown(70)], 70, False),  # the other sees it whole
        ([shown(10, 9, saturated=True), shown(6, 0.1)], 6, False),  # just below the bound: noise
        ([shown(10, 0.1, saturated=True), shown(2, 9)], 10, True),  # a contradiction: the bound stays
        ([shown(10, 9, saturated=True), shown(30, saturated=True)], 30, True),
        ([shown(10, saturated=True)], 10, True),
    ],
)
def test_a_bound_is_never_averaged_in(balls, expected, is_bound):
    radiance, weight, saturated = combined(balls)
    assert radiance[0, 0] == pytest.approx(np.full(3, expected))
    assert weight[0, 0] == sum(ball.weight[0, 0] for ball in balls)
    assert saturated[0, 0] == is_bound


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda sky: sky, None),
        (lambda sky: 1.1 * sky, None),
        (lambda sky: 2 * sky, "b.exr shows what it shares with a.exr 2.00 times as bright"),
        (lambda sky: sky / 4, "0.25 times as bright"),
        (lambda sky: np.roll(sky, 9, axis=1), "different surroundings"),
        (lambda sky: sky[:, ::-1], "different surroundings"),
    ],
    ids=["same", "nearly", "twice", "quarter", "turned", "mirrored"],
)
def test_balls_that_disagree_are_told(rng, change, says):
    sky, one = np.exp(rng.normal(size=(16, 32, 3))), np.ones((16, 32))
    noisy = [values * np.exp(rng.normal(0, 0.03, sky.shape)) for values in (sky, change(sky))]
    balls = [Shown(values, one, one == 0) for values in noisy]
    notes = list(disagreements(["a.exr", "b.exr"], balls))
    assert len(notes) == (says is not None)
    assert says is None or says in notes[0]


def test_what_few_texels_share_is_not_judged(rng):
    sky, weight = np.exp(rng.normal(size=(16, 32, 3))), np.zeros((16, 32))
    weight[0, :5] = 1
    assert not list(disagreements(["a", "b"], [Shown(sky, weight, weight < 0), Shown(5 * sky, weight, weight < 0)]))

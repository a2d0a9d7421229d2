"""Errors of pictures with known faults, by zone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsibr.errors import CheckFailed
from rsibr.store.noise import denominator
from rsibr.validation.flip import exposures_for
from rsibr.validation.objects.object_error import object_error
from tests.validation.doubles import noisy_reference, smooth_map

EXPOSURES = exposures_for(1.0)


@pytest.fixture
def truth(rng):
    return noisy_reference(smooth_map(), 0.01, rng)


@pytest.fixture
def halves(truth):
    left = np.zeros(truth.coverage.shape, dtype=bool)
    left[:, :16] = True
    return {"left": left, "right": ~left, "nowhere": np.zeros_like(left)}


def error(picture, truth, zones):
    return object_error(picture.astype(np.float32), truth, zones, EXPOSURES, "picture")


def test_a_perfect_picture_is_below_the_noise_floor_and_has_its_energy(truth, halves):
    found = error(smooth_map(), truth, halves)
    assert set(found.zones) == {"left", "right"}
    for one in (found.whole, *found.zones.values()):
        assert one.rel_mse.value < 3e-5
        low, high = one.energy_ratio.ci95
        assert low - 1e-3 < 1 < high + 1e-3
        assert one.smape.value < 6e-3
    assert found.noise_floor == pytest.approx(1e-4, rel=0.3)


def test_a_picture_too_bright_in_one_zone_is_found_wrong_there_alone(truth, halves):
    wrong = smooth_map()
    wrong[:, 16:] *= 1.1
    found = error(wrong, truth, halves)
    judged = truth.coverage >= 0.5
    b = smooth_map()[judged].astype(float)
    squared = (0.1 * b) ** 2 / denominator(b)
    expected = squared[halves["right"][judged]].mean()
    right, left = found.zones["right"], found.zones["left"]
    assert right.rel_mse.value == pytest.approx(expected, rel=0.05)
    assert right.rel_mse.ci95[0] > 0.8 * expected
    assert left.rel_mse.value < 0.01 * expected
    assert right.energy_ratio.value == pytest.approx(1.1, abs=2e-3)
    assert left.energy_ratio.value == pytest.approx(1.0, abs=2e-3)
    assert right.smape.value == pytest.approx(0.1 / 2.1, rel=0.05)
    assert right.flip.value > 3 * left.flip.value
    assert right.share + left.share == pytest.approx(1)
    assert found.whole.rel_mse.value == pytest.approx(
        right.share * right.rel_mse.value + left.share * left.rel_mse.value, rel=0.02
    )


def test_intervals_hold_what_the_truth_without_noise_gives(rng, halves):
    """Of 40 truths, 95 % intervals of the energy ratio miss fewer than 8 times (false alarms below 1e-3)."""
    wrong = smooth_map() * np.float32(1.05)
    found = [
        error(wrong, noisy_reference(smooth_map(), 0.2, rng), halves).zones["left"].energy_ratio for _ in range(40)
    ]
    assert sum(not one.ci95[0] <= 1.05 <= one.ci95[1] for one in found) < 8
    spread = np.std([one.value for one in found])
    assert np.mean([one.standard_error for one in found]) == pytest.approx(spread, rel=0.5)


def test_a_channel_black_in_the_truth_alone_has_no_energy_ratio(truth, halves):
    black = replace(truth, buffers=truth.buffers * np.array([1, 1, 0], np.float32))
    assert error(smooth_map(), black, halves).whole.energy_ratio is None


def test_nan_is_refused(truth, halves):
    with pytest.raises(CheckFailed, match="nan"):
        error(np.full_like(smooth_map(), np.nan), truth, halves)

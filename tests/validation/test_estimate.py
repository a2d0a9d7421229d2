"""Confidence intervals against textbook values and simulation."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.validation.estimate import Estimate, jackknife, mean_estimate


def test_the_jackknife_of_a_mean_is_the_textbook_standard_error(rng):
    sample = rng.normal(size=12)
    left_out = np.array([np.delete(sample, k).mean() for k in range(12)])
    estimate = jackknife(sample.mean(), left_out)
    assert estimate.standard_error == pytest.approx(sample.std(ddof=1) / np.sqrt(12))
    assert estimate.degrees_of_freedom == 11


def test_the_interval_is_students():
    low, high = Estimate(1.0, 0.1, 7).ci95  # t(0.975, 7) = 2.3646, any table
    assert (low, high) == pytest.approx((1 - 0.23646, 1 + 0.23646), abs=1e-5)


@pytest.mark.parametrize(
    ("value", "error", "below"), [(1.0, 0.1, False), (0.1, 0.1, True), (-0.01, 0.1, True), (0.0, 0.0, False)]
)
def test_below_the_noise_floor_is_said(value, error, below):
    estimate = Estimate(value, error, 7)
    assert estimate.below_noise_floor is below
    assert ("below the noise floor" in str(estimate)) is below


def test_it_reads_with_its_uncertainty():
    assert str(Estimate(0.01234, 0.0002, 7)) == "0.01234 ± 0.00047"


def test_small_and_exact_numbers_read_well_too():
    assert str(Estimate(3.68e-4, 4.7e-6, 7)) == "(3.68 ± 0.11) × 10⁻⁴"
    assert str(Estimate(-1e-5, 4.7e-6, 7)) == "below the noise floor, < 1.1 × 10⁻⁶"
    assert str(Estimate(0.25, 0.0, 7)) == "0.250"


def test_means_of_unequal_estimates_cover(rng):
    # 400 intervals of 95 % from three views of unlike noise: the expected share is 0.95 to 0.96, its standard error
    # 0.011; outside 0.91–0.99 with probability below 1e-3.
    covered = 0
    for _ in range(400):
        views = []
        for scale in (1.0, 3.0, 0.1):
            sample = scale * rng.normal(size=8)
            views.append(Estimate(sample.mean(), sample.std(ddof=1) / np.sqrt(8), 7))
        low, high = mean_estimate(views).ci95
        covered += low <= 0 <= high
    assert 0.91 <= covered / 400 <= 0.99


def test_the_mean_of_equal_estimates_gains_a_square_root():
    joint = mean_estimate([Estimate(2.0, 0.4, 7)] * 4)
    assert (joint.value, joint.standard_error, joint.degrees_of_freedom) == pytest.approx((2.0, 0.2, 28))


def test_exact_estimates_stay_exact():
    assert mean_estimate([Estimate(0.0, 0.0, 7), Estimate(1.0, 0.0, 7)]).ci95 == (0.5, 0.5)

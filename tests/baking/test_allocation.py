"""Neyman's allocation: as much work as an even one, less noise, nobody starved."""

import numpy as np
import pytest

from rsibr.baking.allocation import LEAST_SHARE, MOST_SHARE, Allocation, equal_work


@pytest.fixture
def spread(rng):
    return rng.lognormal(sigma=0.8, size=4000)


def test_it_takes_as_much_work_as_an_even_one(spread):
    counts = equal_work(16, spread).counts(spread)
    assert counts.mean() == pytest.approx(16, rel=0.01)


def test_no_texel_is_starved_and_none_takes_all(spread):
    spread[:10], spread[10:20] = 0, 1e6
    counts = equal_work(16, spread).counts(spread)
    assert counts.min() == LEAST_SHARE * 16
    assert counts.max() == MOST_SHARE * 16


def test_where_no_bound_is_met_the_gain_is_the_closed_form(rng):
    """1 + CV² of the spread: mean(r²) / mean(r)²."""
    spread = rng.uniform(0.7, 1.3, size=5000)
    gain = Allocation(16).noise(spread) / equal_work(16, spread).noise(spread)
    assert gain == pytest.approx((spread**2).mean() / spread.mean() ** 2, rel=1e-6)


def test_nothing_that_takes_as_much_work_has_less_noise(spread, rng):
    best = equal_work(16, spread)
    least = best.noise(spread)
    shares = best.shares(spread)
    for _ in range(50):
        one, other = rng.integers(len(spread), size=2)
        moved = shares.copy()
        moved[one] += 0.5
        moved[other] -= 0.5
        if moved[other] > LEAST_SHARE * 16 and moved[one] < MOST_SHARE * 16:
            assert (spread**2 / moved).mean() >= least


def test_noise_goes_with_the_inverse_of_the_work(spread):
    once = equal_work(16, spread)
    thrice = Allocation(48, 3 * once.scale)
    assert thrice.noise(spread) == pytest.approx(once.noise(spread) / 3, rel=1e-12)


def test_a_few_noisy_texels_among_silent_ones_get_all_they_may():
    spread = np.zeros(1000)
    spread[:3] = 1.0
    counts = equal_work(16, spread).counts(spread)
    assert (counts[:3] == MOST_SHARE * 16).all()
    assert (counts[3:] == LEAST_SHARE * 16).all()


def test_an_even_allocation_asks_for_no_spread():
    assert (Allocation(7).counts(np.array([0.0, 1.0, 1e9])) == 7).all()

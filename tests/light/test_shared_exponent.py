"""Texels of eight bytes: what they keep, and what they do where a float32 is at its end."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.light.shared_exponent import PRECISION, packed, unpacked


def round_trip(radiance):
    """Radiance of shape (n, 3), packed on the host and unpacked on the device, as float64."""
    words = packed(np.asarray(radiance, dtype=np.float32))
    mantissas, scale = unpacked(mi.Vector2u(np.ascontiguousarray(words.T)))
    return np.array(mantissas * scale, dtype=np.float64).T


def test_errors_stay_below_the_precision_over_sixty_decades(rng):
    """Each channel within `PRECISION` of the greatest, colours of every saturation."""
    greatest = 10.0 ** rng.uniform(-32, 38, 100_000)
    colours = rng.random((100_000, 3)) ** rng.integers(1, 9, (100_000, 1)) * rng.choice([-1, 1], (100_000, 3))
    radiance = (colours / np.abs(colours).max(axis=1, keepdims=True) * greatest[:, None]).astype(np.float32)
    error = np.abs(round_trip(radiance) - radiance).max(axis=1)
    assert (error / np.abs(radiance).max(axis=1)).max() <= PRECISION


def test_the_error_has_no_sign(rng):
    """Rounded, not cut: the mean over 10⁵ texels errs by less than 5σ of even rounding errors."""
    radiance = rng.uniform(0.5, 1, (100_000, 3)).astype(np.float32)
    sigma = PRECISION / np.sqrt(12) / np.sqrt(radiance.size)
    assert abs((round_trip(radiance) - radiance).mean()) < 5 * sigma


@pytest.mark.parametrize("below", [1, 2, 8, 31, 32, 33, 63, 64, 65, 1000])
def test_just_below_a_power_of_two_nothing_overflows(below):
    """Where the greatest channel is rounded up its mantissa needs one bit more; it takes the next exponent."""
    value = np.float32(1 - below * 2.0**-24)
    radiance = np.array([[value, 0.25, 0.5], [0.5, value, 0.25], [0.25, 0.5, value]])
    assert np.abs(round_trip(radiance) - radiance).max() <= PRECISION


def test_zero_and_powers_of_two_are_exact():
    radiance = np.ldexp(1.0, np.arange(-100, 128))[:, None] * [1, 0.5, 0]
    assert np.array_equal(round_trip(radiance), radiance)
    assert not round_trip(np.zeros((1, 3))).any()


def test_a_sun_and_a_dark_sky_are_both_kept():
    """Hard case 24: each texel has an exponent of its own."""
    radiance = np.array([[1e6, 0.9e6, 0.7e6], [0.01, 0.012, 0.02]])
    assert np.abs(round_trip(radiance) / radiance - 1).max() < 2 * PRECISION
    largest = np.full((1, 3), np.finfo(np.float32).max, dtype=np.float64)
    assert np.abs(round_trip(largest) / largest - 1).max() <= 2 * PRECISION


def test_what_is_too_dark_for_the_exponent_becomes_zero_gently():
    """Below 1e-33 the steps stay as they are, 2⁻¹²⁶, and no texel becomes a denormal or a NaN."""
    radiance = 10.0 ** -np.arange(33, 45)[:, None] * np.ones(3)
    assert np.abs(round_trip(radiance) - radiance).max() <= 2.0**-127 * (1 + 1e-6)


def test_signs_are_kept_and_what_is_not_finite_stays_so():
    """A NaN or an infinity in a map may not pass for radiance."""
    got = round_trip([[-1, 2, -0.5], [np.nan, 1, 1], [1, np.inf, 1], [-np.inf, 1, 1]])
    assert np.array_equal(got[0], [-1, 2, -0.5])
    assert np.isnan(got[1:]).all()

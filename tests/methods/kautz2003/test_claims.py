"""Measures of the paper's claims, where their answer is known."""

import numpy as np
import pytest

from rsibr.methods.kautz2003 import claims
from tests.arrays import unit_vectors
from tests.methods.kautz2003.skies import faces_of, grey, harmonic

AXIS = np.array([0.3, 0.6, -0.2])
CONSTANT = np.full((6, 16, 16, 3), 2.0, np.float32)
GRADIENT = faces_of(grey(lambda d: 1 + d @ AXIS), 32)


def test_under_a_constant_light_nothing_errs():
    assert claims.coefficients_error(CONSTANT) < 1e-6
    assert claims.diffuse_error(CONSTANT) < 2e-3
    assert claims.box_error(CONSTANT, 10.0) < 1e-5
    assert claims.shift_variance(CONSTANT, 1.5, turns=2) < 1e-5
    assert claims.border_step(CONSTANT, 2.0, borders=False) < 1e-6


def test_diffuse_errs_by_the_band_that_is_lost(rng):
    """Under 2 + a Y_4, Lambert's law gives 2 − a Y_4 / 24 and nine coefficients give 2."""
    faces = faces_of(grey(lambda d: 2 + harmonic(4, 2, d)), 32)
    n = unit_vectors(rng, 100)
    assert claims.lambert(faces, n)[:, 0] == pytest.approx(2 - harmonic(4, 2, n) / 24, abs=1e-3)
    mean_square = 1 / (4 * np.pi)  # of an orthonormal function
    assert claims.diffuse_error(faces) == pytest.approx(np.sqrt(mean_square) / 24 / 2, rel=0.03)


def test_a_smooth_light_needs_few_texels_and_a_sun_more():
    assert claims.coefficients_error(GRADIENT, 8) < 5e-3
    sun = claims.small_sun(64, np.array([0.48, 0.6, 0.64]))
    assert claims.coefficients_error(sun, 4) > 2 * claims.coefficients_error(sun, 32) > 0.01


def test_a_small_sun_is_one_texel_in_its_direction():
    direction = np.array([0.48, -0.6, 0.64])
    faces = claims.small_sun(64, direction, sky=0.5)
    lit = claims.lambert(faces, np.stack([direction, -direction]))[:, 0]
    assert (faces > 1).sum() == 3
    assert lit[1] == pytest.approx(0.5, rel=1e-3)
    assert lit[0] > 0.6


def test_turning_the_cube_changes_what_the_box_filter_shows():
    light = faces_of(grey(lambda d: 0.1 + np.exp(60 * (d @ [0.36, 0.48, 0.8] - 1))), 32)
    box, lobe = claims.shift_variance(light, 2.5, turns=4), claims.shift_variance(light, 0, exponent=30.0, turns=4)
    assert box > 5 * lobe


def test_directions_are_even():
    d = claims.even_directions(5000)
    assert np.linalg.norm(d, axis=1) == pytest.approx(1)
    assert (d.T @ d / len(d)) == pytest.approx(np.eye(3) / 3, abs=2e-3)

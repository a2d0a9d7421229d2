"""Irradiance from nine coefficients against closed forms."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.octahedral import texel_directions
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.harmonic_irradiance import HarmonicIrradiance, harmonics, light_coefficients
from rsibr.light.radiance import Light
from tests.arrays import unit_vectors

RESOLUTION = 96
FACTORS = [1, *[2 / 3] * 3, *[1 / 4] * 5]  # ∫ cos θ P_l dω / π over the hemisphere


def light_of(radiance, **parts):
    d = np.array(texel_directions(RESOLUTION), dtype=np.float64).T
    image = np.repeat(radiance(d)[:, None], 3, axis=1) * [1.0, 0.5, 2.0]
    return Light(image.reshape(RESOLUTION, RESOLUTION, 3).astype(np.float32), **parts)


def looked_up(light, normals):
    irradiance = HarmonicIrradiance.of(light_coefficients(light, delta=True))
    return np.array(irradiance.mean_radiance(mi.Vector3f(normals.T.astype(np.float32)))).T


def test_harmonics_are_orthonormal():
    light, angles = light_of(lambda d: harmonics(*d.T)[5]), np.eye(9)[5]
    np.testing.assert_allclose(light_coefficients(light), angles[:, None] * [1.0, 0.5, 2.0], atol=2e-3)


def test_a_gradient(rng):
    """L = 1 + a·ω: irradiance over π is 1 + 2/3 a·n."""
    a, n = np.array([0.3, 0.6, -0.2]), unit_vectors(rng, 100)
    expected = (1 + 2 / 3 * n @ a)[:, None] * [1.0, 0.5, 2.0]
    np.testing.assert_allclose(looked_up(light_of(lambda d: 1 + d @ a), n), expected, atol=1e-3)


@pytest.mark.parametrize("term", range(9))
def test_each_harmonic_is_scaled_by_its_factor(term, rng):
    n = unit_vectors(rng, 100)
    found = looked_up(light_of(lambda d: 2 + harmonics(*d.T)[term]), n)
    expected = 2 + FACTORS[term] * harmonics(*n.T)[term]
    np.testing.assert_allclose(found, expected[:, None] * [1.0, 0.5, 2.0], atol=3e-3)


def test_bands_above_the_second_are_not_seen(rng):
    """Band 3 has the factor 0 in the exact irradiance; band 4, −π/24, is left out."""
    n = unit_vectors(rng, 100)
    for band in (3, 4):
        legendre = np.polynomial.legendre.Legendre.basis(band)
        found = looked_up(light_of(lambda d, p=legendre: 1 + p(d[:, 1])), n)
        np.testing.assert_allclose(found, np.broadcast_to([1.0, 0.5, 2.0], found.shape), atol=3e-3)


def test_a_delta_light_has_its_coefficients_and_its_shadow_is_not_negative(rng):
    delta = DeltaLights(np.array([[0, 0.6, 0.8]], np.float32), np.full((1, 3), 3.0, np.float32))
    light = light_of(lambda d: 0 * d[:, 0], delta=delta)
    expected = 3 * np.stack(harmonics(*delta.directions[0].astype(np.float64)))
    np.testing.assert_allclose(light_coefficients(light, delta=True), np.repeat(expected[:, None], 3, 1), atol=1e-6)
    assert not light_coefficients(light).any()
    found = looked_up(light, unit_vectors(rng, 200))
    assert found.min() == 0
    assert 0.9 < found.max() / (3 / np.pi) < 1.1  # 17/16 toward the light

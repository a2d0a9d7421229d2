"""Nine coefficients of known lights, and Lambert's law under each band."""

import numpy as np
import pytest
from scipy.integrate import quad

from rsibr.light.harmonic_irradiance import COSINE_LOBE, HarmonicIrradiance, harmonics
from rsibr.methods.kautz2003.nine_coefficients import FACE, coefficients
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.kautz2003.skies import NINE, faces_of, grey, harmonic, solid_angle

SIZE = 32
AXIS = np.array([0.3, 0.6, -0.2])


def lit(sky, face=SIZE, size=SIZE):
    return coefficients(faces_of(sky, size), face)


def test_the_basis_is_that_of_spherical_harmonics(rng):
    d = unit_vectors(rng, 50)
    for found, (band, order) in zip(harmonics(*d.T), NINE, strict=True):
        assert found == pytest.approx(harmonic(band, order, d), abs=1e-12)


@pytest.mark.parametrize("i", range(9))
def test_each_function_has_itself_as_its_only_coefficient(i):
    found = lit(grey(lambda d: harmonic(*NINE[i], d)))
    assert found == pytest.approx(np.repeat(np.eye(9)[:, [i]], 3, axis=1), abs=1e-3)


def test_a_constant_and_a_gradient_are_exact_at_eight_texels():
    found = lit(grey(lambda d: 1 + d @ AXIS), face=FACE)[:, 0]
    first = np.sqrt(4 * np.pi / 3)
    wanted = [np.sqrt(4 * np.pi), first * AXIS[1], first * AXIS[2], first * AXIS[0], 0, 0, 0, 0, 0]
    assert found == pytest.approx(wanted, abs=5e-3)
    assert found[4:] == pytest.approx(0, abs=1e-5)


def test_channels_are_kept_apart():
    found = lit(lambda d: np.stack([1 + d[..., 0], 2 + d[..., 1], 3 + d[..., 2]], axis=-1))
    assert found[0] / np.sqrt(4 * np.pi) == pytest.approx([1, 2, 3], rel=1e-5)
    assert (found[1:4] / np.sqrt(4 * np.pi / 3)).round(2).tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


def test_the_factors_are_those_of_the_clamped_cosine():
    """Â_l = 2π ∫ P_l(c) max(c, 0) dc; the fourth band, −π/24, is not in the table."""
    for i, factor in enumerate(COSINE_LOBE):
        band = NINE[i][0]
        assert factor == pytest.approx(cosine_factor(band))
    assert cosine_factor(3) == pytest.approx(0, abs=1e-9)
    assert cosine_factor(4) == pytest.approx(-np.pi / 24)


def cosine_factor(band):
    return 2 * np.pi * quad(lambda c: np.polynomial.Legendre.basis(band)(c) * c, 0, 1)[0]


@pytest.mark.parametrize("i", range(9))
def test_lambert_under_each_function_of_three_bands(i, rng):
    n = unit_vectors(rng, 40)
    # On top of a constant, so that nothing is negative and cut off
    found = diffuse(lit(grey(lambda d: 2 + harmonic(*NINE[i], d))), n)
    band = NINE[i][0]
    assert found == pytest.approx(2 + cosine_factor(band) / np.pi * harmonic(*NINE[i], n), abs=1e-3)


def diffuse(values, n):
    return to_numpy(HarmonicIrradiance.of(values).mean_radiance(vector(n)))[0]


def test_the_fourth_band_is_lost(rng):
    """A Lambertian surface shows −1/24 of it."""
    n = unit_vectors(rng, 40)
    assert diffuse(lit(grey(lambda d: 2 + harmonic(4, 3, d))), n) == pytest.approx(2, abs=2e-3)


def test_what_would_be_negative_is_cut_off():
    sun = grey(lambda d: np.where(d[..., 2] > 0.995, 400.0, 0.0))
    assert diffuse(lit(sun), np.array([[0, 0, 1.0]])) > 0.5
    # Opposite, the sum of the three bands is (1/4 − 2·1/2 + 5/4·1/4) of L/π < 0
    assert diffuse(lit(sun), np.array([[np.sin(2.2), 0, np.cos(2.2)]])) == 0


def test_finer_faces_are_averaged_by_solid_angle():
    """Coefficient 0 is the light's whole energy: a texel at a corner holds a fifth of the centre's."""
    faces = np.zeros((6, 64, 64, 3), np.float32)
    faces[2, 0, 0], faces[3, 31, 31] = 1.0, 2.0
    energy = solid_angle(64, 0, 0) + 2 * solid_angle(64, 31, 31)
    assert coefficients(faces, 8)[0, 0] * np.sqrt(4 * np.pi) == pytest.approx(energy, rel=1e-4)


def test_coarse_faces_are_taken_as_they_are():
    faces = faces_of(grey(lambda d: 1 + d @ AXIS), 4)
    assert coefficients(faces, 8) == pytest.approx(coefficients(faces, 4))

"""Band factors against direct quadrature, and the nearest kernel."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from rsibr.methods.kautz2003.band_factors import BANDS, bias_for, box, exponent_for, gaussian, ggx, phong
from rsibr.methods.kautz2003.cube_pyramid import CubePyramid
from rsibr.methods.kautz2003.faces import box_levels
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.kautz2003.skies import faces_of, grey


@pytest.mark.parametrize("exponent", [1.0, 10.0, 33.3, 225.0])
def test_phong_is_the_integral_of_legendre_polynomials(exponent):
    for band in (1, 2, 3, 8, 16):
        wanted = quad(lambda c, band=band: (exponent + 1) * c**exponent * eval_legendre(band, c), 0, 1, limit=200)[0]
        assert phong(exponent, np.array([band]))[0] == pytest.approx(wanted, abs=1e-8)


def test_a_narrow_phong_lobe_is_a_gaussian():
    assert phong(2000.0) == pytest.approx(gaussian(1 / np.sqrt(2000)), abs=2e-3)


def test_ggx_is_narrower_with_less_roughness_and_ends_in_a_mirror():
    assert ggx(1e-5) == pytest.approx(1, abs=1e-3)
    rows = np.stack([ggx(alpha) for alpha in (0.02, 0.1, 0.3)])
    assert (np.diff(rows[:, BANDS < 16], axis=0) < 0).all()


@pytest.mark.parametrize("bias", [1.0, 2.5])
def test_box_factors_are_those_that_the_pyramid_has(bias, rng):
    """⟨filtered · Y⟩ / ⟨Y · Y⟩ of zonal harmonics about many axes, in a cube of 32²."""
    d = unit_vectors(rng, 8000)
    for band in (2, 8):
        ratios = []
        for axis in unit_vectors(rng, 6):
            faces = faces_of(grey(lambda w, axis=axis, band=band: eval_legendre(band, w @ axis)), 32, samples=2)
            seen = to_numpy(CubePyramid.of(box_levels(faces), seams=True).lookup(vector(d), mi.Float(bias)))[0]
            wave = eval_legendre(band, d @ axis)
            ratios.append(seen @ wave / (wave @ wave))
        assert np.mean(ratios) == pytest.approx(box(32, bias, np.array([band]))[0], abs=0.012)


@pytest.mark.parametrize("bias", [0.0, 1.7, 4.0, 5.4])
def test_the_bias_of_a_box_kernel_is_its_own(bias):
    found, error = bias_for(box(64, bias), 64)
    assert found == pytest.approx(bias, abs=1e-3)
    assert error < 1e-6


@pytest.mark.parametrize("exponent", [1.0, 10.0, 225.0, 3000.0])
def test_the_exponent_of_phong_is_its_own(exponent):
    found, error = exponent_for(phong(exponent))
    assert found == pytest.approx(exponent, rel=0.01)
    assert error < 2e-3


def test_the_pair_of_the_paper_is_found_at_faces_of_64():
    """Figure 5 pairs N = 225 with b = 2.25; doubling the faces' size adds 1."""
    assert bias_for(phong(225.0), 64)[0] == pytest.approx(2.25, abs=0.25)
    assert bias_for(phong(225.0), 128)[0] == pytest.approx(bias_for(phong(225.0), 64)[0] + 1, abs=1e-3)


@pytest.mark.parametrize("exponent", [100, 225, 1000])
def test_the_bias_has_about_the_second_moment_of_the_lobe(exponent):
    """1 − Λ_1 is half the mean square angle; 1/(N + 2) for Phong."""
    bias, error = bias_for(phong(float(exponent)), 64)
    assert 1 - box(64, bias, np.array([1]))[0] == pytest.approx(1 / (exponent + 2), rel=0.35)
    assert error < 0.05
    assert len(BANDS) == len(phong(1.0))

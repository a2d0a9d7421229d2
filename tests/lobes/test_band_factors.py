"""Band factors against direct quadrature, and the nearest Phong lobe."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from rsibr.lobes.band_factors import BANDS, exponent_for, gaussian, ggx, phong


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


@pytest.mark.parametrize("exponent", [1.0, 10.0, 225.0, 3000.0])
def test_the_exponent_of_phong_is_its_own(exponent):
    found, error = exponent_for(phong(exponent))
    assert found == pytest.approx(exponent, rel=0.01)
    assert error < 2e-3

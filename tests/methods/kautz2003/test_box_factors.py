"""Band factors of a box-filtered cube against the cube itself, and the nearest bias."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.special import eval_legendre

from rsibr.lobes.band_factors import BANDS, phong
from rsibr.methods.kautz2003.box_factors import bias_for, box
from rsibr.methods.kautz2003.cube_pyramid import CubePyramid
from rsibr.methods.kautz2003.faces import box_levels
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.kautz2003.skies import faces_of, grey


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

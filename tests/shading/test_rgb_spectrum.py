"""Spectra of colours give these colours again, and that of white is smooth."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.shading.rgb_spectrum import RgbSpectrum, smoothest_basis


@pytest.mark.parametrize("colour", [(1, 1, 1), (1, 0, 0), (0.2, 0.9, 0.1), (0, 0, 3)])
def test_mitsuba_sees_the_colour_again(colour):
    with backend.rendering("spectral"):
        u = (dr.arange(mi.Float, 20000) + 0.5) / 20000
        wavelengths, weight = mi.sample_rgb_spectrum(mi.sample_shifted(u))
        spectrum = RgbSpectrum().at(mi.Color3f(*colour), wavelengths)
        seen = np.array(mi.spectrum_to_srgb(spectrum * weight, wavelengths)).mean(axis=1)
    np.testing.assert_allclose(seen, colour, atol=2e-4)


def test_white_is_positive_and_nearly_even():
    with backend.rendering("spectral"):
        white = smoothest_basis().sum(axis=1)
    assert white.min() > 0
    assert 0.5 < white[8:69].min() < white.max() < 2  # 400 to 700 nm

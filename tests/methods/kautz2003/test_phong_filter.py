"""The Phong-filtered cube against the band factors of its lobe."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.phong_filter import phong_filtered, size_for
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.kautz2003.skies import directions, faces_of, grey, harmonic, solid_angle

BANDS = ((0, 0), (1, 0), (2, 1), (3, -2), (6, 4))


def factors(n, band):
    """HARD_CASES row 19: Λ_0 = 1, Λ_1 = (n+1)/(n+2), Λ_l = Λ_{l−2} (n+2−l)/(n+1+l)."""
    found = {0: 1.0, 1: (n + 1) / (n + 2)}
    for l in range(2, band + 1):  # noqa: E741  # the band's usual letter
        found[l] = found[l - 2] * (n + 2 - l) / (n + 1 + l)
    return found[band]


@pytest.mark.parametrize("exponent", [1, 10, 100])
def test_each_band_is_multiplied_by_its_factor(exponent, rng):
    """Texels to quadrature, lookups between them to bilinear interpolation."""
    sky = grey(lambda d: 2 + sum(harmonic(*one, d) for one in BANDS))
    faces = faces_of(sky, 64)
    wanted = lambda d: 2 + sum(factors(exponent, band) * harmonic(band, order, d) for band, order in BANDS)  # noqa: E731
    filtered = phong_filtered(faces, exponent)
    d = directions(filtered.shape[1])[..., 0, :]
    assert filtered[..., 0] == pytest.approx(wanted(d), abs=4e-3)
    n = unit_vectors(rng, 300)
    light = KautzLight.of(faces, exponent=exponent, borders=True)
    assert to_numpy(light.glossy.lookup(vector(n), mi.Float(0)))[0] == pytest.approx(wanted(n), abs=2e-2)


@pytest.mark.slow
def test_a_narrow_lobe_too(rng):
    exponent = 225
    faces = faces_of(grey(lambda d: 2 + harmonic(20, 7, d)), 128)
    filtered = phong_filtered(faces, exponent)
    assert filtered.shape[1] == 128
    d = directions(128)[..., 0, :]
    assert filtered[..., 0] == pytest.approx(2 + factors(exponent, 20) * harmonic(20, 7, d), abs=6e-3)


@pytest.mark.parametrize("exponent", [1, 40])
def test_a_constant_light_stays_as_it_is(exponent):
    assert phong_filtered(np.full((6, 32, 32, 3), 3.0, np.float32), exponent) == pytest.approx(3.0, rel=1e-5)


def test_one_lit_texel_spreads_as_the_lobe():
    """(n+1)/2π cos^n at every direction, and nothing behind."""
    faces = np.zeros((6, 64, 64, 3), np.float32)
    faces[4, 20, 40] = 1.0
    angle = solid_angle(64, 20, 40)
    filtered = phong_filtered(faces, 60.0)
    assert filtered.shape[1] == 64
    d = directions(64)[..., 0, :]
    cosine = np.maximum(d @ d[4, 20, 40], 0)
    assert filtered[..., 1] == pytest.approx(61 / (2 * np.pi) * angle * cosine**60, rel=2e-3, abs=1e-7)


def test_sizes_follow_the_width_of_the_lobe():
    assert [size_for(n, 256) for n in (1, 25, 100, 225, 1600, 1e5)] == [32, 32, 64, 128, 256, 256]
    assert size_for(1.0, 16) == 16

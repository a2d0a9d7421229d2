"""Sums over an illumination table: against a plain sum, and against closed forms under spherical harmonics."""

import numpy as np
import pytest
from scipy.special import sph_harm_y

from rsibr.methods.miller1984.convolution import convolved, latitudes, texel_areas
from rsibr.methods.miller1984.reflectance import lambert, mirror, phong, self_luminous, zonal
from tests.methods.miller1984.scene import device_polar_directions, polar_directions

ROWS = 108


def plain_sum(illumination, f, rows, columns):
    height, width, _ = illumination.shape
    x = polar_directions(rows, columns).reshape(-1, 3) @ polar_directions(height, width).reshape(-1, 3).T
    weighted = f(x) * np.repeat(texel_areas(height, width)[:, 0, 0], width)
    return (weighted @ illumination.reshape(-1, 3)).reshape(rows, columns, 3) / (4 * np.pi)


@pytest.mark.parametrize("size", [(5, 7), (6, 14), (5, 6), (4, 28), (7, 10), (1, 2), (10, 14)])
@pytest.mark.parametrize(
    ("f", "plain"),
    [
        (lambert(), lambda x: np.maximum(x, 0)),
        (self_luminous(), np.ones_like),
        (phong(7.3), lambda x: np.maximum(x, 0) ** 7.3),
        (phong(300.0), lambda x: np.maximum(x, 0) ** 300),
        (zonal(np.array([0.2, 0.7, 1.0]), np.array([0.0, 1.0, 3.0])), lambda x: np.interp(x, [0.2, 0.7, 1], [0, 1, 3])),
    ],
    ids=["lambert", "self-luminous", "phong", "narrow phong", "zonal"],
)
def test_it_is_the_sum_over_all_texels(f, plain, size, rng):
    illumination = rng.random((10, 14, 3))
    assert np.allclose(convolved(illumination, f, *size), plain_sum(illumination, plain, *size), rtol=1e-11, atol=1e-12)


def test_rows_and_columns_lie_as_in_the_projection():
    assert np.allclose(polar_directions(36), device_polar_directions(36), atol=1e-6)
    assert np.allclose(np.cos(latitudes(36)), device_polar_directions(36)[:, 0, 1], atol=1e-6)


def harmonic(band, m, rows=ROWS):
    """Real harmonic about +Y, asymmetric for m ≠ 0, in three channels."""
    d = polar_directions(rows)
    value = sph_harm_y(band, abs(m), np.arccos(np.clip(d[..., 1], -1, 1)), np.arctan2(d[..., 0], d[..., 2]))
    return np.repeat((value.real if m >= 0 else value.imag)[..., None], 3, axis=-1)


def band_factor(f, band, m, rows=36):
    """Factor by which the sum multiplies a harmonic: least squares, and the greatest deviation from proportionality."""
    found, own = convolved(harmonic(band, m), f, rows, 2 * rows), harmonic(band, m, rows)
    factor = (found * own).sum() / (own * own).sum()
    return factor, np.abs(found - factor * own).max()


@pytest.mark.parametrize(("band", "factor"), [(0, np.pi), (1, 2 * np.pi / 3), (2, np.pi / 4), (3, 0), (4, -np.pi / 24)])
def test_lambert_multiplies_each_band_by_its_factor(band, factor):
    """Ramamoorthi & Hanrahan (2001), eq. 8 and 9, over the printed 4π."""
    for m in {0, 1, -2} & set(range(-band, band + 1)):
        found, off = band_factor(lambert(), band, m)
        assert found == pytest.approx(factor / (4 * np.pi), abs=1e-4)
        assert off < 1e-4


@pytest.mark.parametrize("n", [1, 10, 100, 225])
def test_hc19_phong_multiplies_each_band_by_its_factor(n):
    """Λ₀ = 1, Λ₁ = (n+1)/(n+2), Λ_l = Λ_{l−2} (n+2−l)/(n+1+l), over 2(n + 1)."""
    bands = [1.0, (n + 1) / (n + 2)]
    for band in range(2, 5):
        bands.append(bands[band - 2] * (n + 2 - band) / (n + 1 + band))
    for band, expected in enumerate(bands):
        found, off = band_factor(phong(n), band, min(band, 1))
        assert found * 2 * (n + 1) == pytest.approx(expected, abs=2e-6 * n + 1e-4)
        assert off * 2 * (n + 1) < 5e-3


def test_a_gradient_is_known(gradient_axis):
    """∫ (1 + a·ω) max(N·ω, 0) dω = π + 2π/3 a·N."""
    a = gradient_axis
    sky = np.repeat(1 + (polar_directions(ROWS) @ a)[..., None], 3, axis=-1)
    closed = (np.pi + 2 * np.pi / 3 * polar_directions(36) @ a) / (4 * np.pi)
    assert np.allclose(convolved(sky, lambert(), 36, 72), closed[..., None], rtol=1e-4)


def test_a_self_luminous_material_is_the_mean_everywhere(rng):
    illumination = rng.random((12, 24, 3))
    mean = (illumination * texel_areas(12, 24)).sum(axis=(0, 1)) / (4 * np.pi)
    assert np.allclose(convolved(illumination, self_luminous(), 6, 12), mean)


def test_a_mirror_has_no_sum(rng):
    assert not convolved(rng.random((4, 8, 3)), mirror(), 4, 8).any()

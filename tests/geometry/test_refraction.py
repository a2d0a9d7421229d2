"""Snell's law in components, for NumPy and Dr.Jit arrays."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.refraction import emerging, refracted

ETA = 1.5


def test_the_ratio_of_the_sines_is_the_index_of_refraction():
    angle = np.linspace(0, np.pi / 2, 50)
    x, y, height_squared = refracted(np.sin(angle), 0 * angle, ETA)
    inner = np.arctan2(np.hypot(x, y), np.sqrt(height_squared))
    assert np.sin(angle) == pytest.approx(ETA * np.sin(inner), abs=1e-14)


def test_emerging_undoes_refraction():
    x, y, _ = refracted(0.3, -0.7, ETA)
    x, y, height_squared = emerging(x, y, ETA)
    assert (x, y, height_squared) == pytest.approx((0.3, -0.7, 1 - 0.3**2 - 0.7**2))


def test_beyond_the_critical_angle_the_squared_height_is_negative():
    critical = 1 / ETA
    assert emerging(critical * 1.001, 0.0, ETA)[2] < 0 < emerging(critical * 0.999, 0.0, ETA)[2]


def test_drjit_and_numpy_agree():
    x, y = np.array([0.1, 0.6, 0.0]), np.array([0.2, -0.7, 0.9])
    on_device = refracted(mi.Float(x.astype(np.float32)), mi.Float(y.astype(np.float32)), ETA)
    for got, expected in zip(on_device, refracted(x, y, ETA), strict=True):
        assert np.array(got) == pytest.approx(expected, abs=1e-6)

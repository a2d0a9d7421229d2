"""Spheres beside the claims: under a sky of one radiance each shows that radiance, and a lamp is where it is."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.methods.kautz2003 import claim_pictures as pictures
from rsibr.methods.kautz2003 import claims

SIZE = 16
GREY = np.full((6, 16, 16, 3), 2.0, dtype=np.float32)

MAKE = {
    "matte": lambda faces: pictures.matte_sphere(faces, SIZE),
    "nine terms": lambda faces: pictures.nine_term_sphere(faces, 8, SIZE),
    "phong": lambda faces: pictures.phong_sphere(faces, 10.0, SIZE),
    "box": lambda faces: pictures.box_sphere(faces, 2.0, size=SIZE),
}


@pytest.mark.parametrize("name", MAKE)
def test_a_grey_sky_makes_a_grey_sphere(name):
    made = MAKE[name](GREY)
    assert made.shape == (SIZE, SIZE, 3)
    inside = np.isfinite(made[..., 0])
    assert inside.mean() == pytest.approx(np.pi / 4, abs=0.05)
    assert made[inside] == pytest.approx(2.0, rel=0.02)  # quadrature over coarse faces


@pytest.mark.parametrize("name", MAKE)
def test_a_lamp_above_lights_the_upper_rows(name):
    made = MAKE[name](claims.small_sun(16, np.array([0.05, 0.8, 0.6]), sky=0.1))
    assert np.nanmean(made[: SIZE // 2]) > 1.5 * np.nanmean(made[SIZE // 2 :])


def test_a_wider_lobe_needs_a_larger_bias():
    assert pictures.box_bias(10.0, 64) > pictures.box_bias(100.0, 64) > pictures.box_bias(225.0, 64)

"""The three-dimensional table of section 9: what it holds exactly, and what it cannot hold."""

import numpy as np
import pytest

from rsibr.methods.miller1984.isotropic_table import isotropic, mean_over_turn, node_cosines, radiance_by_turn
from tests.methods.miller1984.scene import glossy, inputs, light, matte, mirror, polar_directions, sky
from tests.methods.miller1984.test_method import grey, miller1984, pairs, radiance

ROWS = 72


def test_a_lobe_has_the_integral_one_at_every_angle():
    for cosine in node_cosines():
        x, values = mean_over_turn([glossy(0.1)], cosine)
        assert (np.diff(x) > 0).all()
        sine = np.sqrt(1 - x**2)
        assert 2 * np.pi * np.trapezoid(values * sine, -np.arccos(x)) == pytest.approx(1)


@pytest.mark.parametrize("lobes", [[glossy(0.1)], [matte(0.3, 0.2, 0.1), glossy(0.2), mirror((0.2, 0.2, 0.2))]])
def test_a_constant_sky_gives_the_albedo(lobes, rng):
    method = isotropic(inputs(light(grey, 64), *lobes), illumination_rows=ROWS)
    n, v = pairs(rng, 200)
    cosine = np.sqrt(np.maximum((n * v).sum(axis=1), 0))
    albedo = sum(np.interp(cosine, [0, 1], [1, 0.6])[:, None] * table[0] for _, table in lobes)
    assert np.allclose(radiance(method, n, v), 2 * albedo, rtol=0.03)


def test_it_is_the_mean_over_the_turn_of_the_normal():
    """Against direct sums of the lobe itself, at one of the table's view angles."""
    lobes, cosine = [glossy(0.2)], node_cosines()[6]
    lit = inputs(light(sky), *lobes)
    method = isotropic(lit, illumination_rows=ROWS)
    r = np.array([0.48, 0.6, 0.64])
    x = np.cross(r, [0, 1, 0])
    n = cosine * r + np.sqrt(1 - cosine**2) * x / np.linalg.norm(x)
    v = 2 * cosine * n - r
    direct = radiance_by_turn(sky(polar_directions(ROWS)), lobes, r, cosine)
    energy = radiance_by_turn(np.ones((ROWS, 2 * ROWS, 3)), lobes, r, cosine).mean(axis=0)
    albedo = np.interp(np.sqrt(cosine), [0, 1], [1, 0.6]) * 0.5
    assert np.allclose(radiance(method, n[None], v[None])[0], direct.mean(axis=0) / energy * albedo, rtol=0.04)


def test_head_on_nothing_is_left_out_and_at_an_angle_something_is():
    """The claim that three dimensions describe an isotropic BRDF completely: false but for lobes symmetric about R."""
    illumination, r = sky(polar_directions(ROWS)), np.array([0.48, 0.6, 0.64])

    def spread(cosine):
        found = radiance_by_turn(illumination, [glossy(0.2)], r, cosine)
        return np.ptp(found, axis=0).max() / found.mean()

    assert spread(1.0) < 1e-3
    assert spread(0.3) > 0.3


def test_it_is_nearer_to_the_lobe_than_a_phong_lobe_is(rng):
    """Direct sums of the lobe at single points."""
    lobes = [glossy(0.15)]
    lit, illumination = inputs(light(sky), *lobes), sky(polar_directions(ROWS))
    grey_sky = np.ones((ROWS, 2 * ROWS, 3))
    errors = {isotropic: 0.0, miller1984: 0.0}
    made = {make: make(lit, illumination_rows=ROWS) for make in errors}
    for cosine in (0.9, 0.6, 0.35):
        r = np.array([0.1, 0.95, 0.2958])
        r /= np.linalg.norm(r)
        exact = radiance_by_turn(illumination, lobes, r, cosine, 8)
        exact *= 0.5 * np.interp(np.sqrt(cosine), [0, 1], [1, 0.6]) / radiance_by_turn(grey_sky, lobes, r, cosine, 8)
        n = _normals(r, cosine, 8)
        v = 2 * cosine * n - r
        for make, method in made.items():
            errors[make] += np.abs(radiance(method, n, v) - exact).mean() / exact.mean()
    assert errors[isotropic] < errors[miller1984]


def _normals(r, cosine, turns):
    x = np.cross(r, np.eye(3)[np.argmin(np.abs(r))])
    x /= np.linalg.norm(x)
    turn = np.arange(turns)[:, None] * 2 * np.pi / turns
    return cosine * r + np.sqrt(1 - cosine**2) * (np.cos(turn) * x + np.sin(turn) * np.cross(r, x))

"""The facet pyramid: each level is the mirrored light through a Gaussian of the stated width; together their sum."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.half_vector_map import half_vector_point, half_vector_texels
from rsibr.methods.rsibr.half_vector_pyramid import (
    LEVELS,
    balance,
    finest_resolution,
    gathered,
    level_variances,
    lookup,
    texel_angle,
)
from tests.arrays import point, to_numpy, vector
from tests.light.test_environment_pyramid import legendre, picture

G = 96
VIEW = np.array([1.0, 2.0, 3.0])


def weights(levels):
    """Tables that give each level one weight at all angles."""
    return [CosineTable.of(np.tile([w, w, w, 1.0], (5, 1))) for w in levels]


def facet_light(light, levels):
    frame = mi.Matrix3f(view_frame(VIEW).astype(np.float32))
    tables = weights(levels)
    return gathered(frame, light, tables, balance(tables, G), G)


def at(texels, n):
    return to_numpy(lookup(texels, G, half_vector_point(vector(n)))).T[:, :3]


def cap(rng, count, least):
    """Unit normals in the map's frame with z above `least`."""
    z = rng.uniform(least, 1, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


@pytest.mark.parametrize(("n", "expected"), [(16, 80), (256, 80), (384, 96), (512, 128), (4096, 256)])
def test_its_finest_level_has_a_quarter_of_the_texels_within_bounds(n, expected):
    assert finest_resolution(n) == expected


def test_texels_span_the_angle_that_two_neighbours_are_apart():
    for polar in (0.0, 0.5, 1.2, np.pi / 2):
        p = np.tan(polar / 2)
        apart = 2 * (np.arctan(p + 1 / G) - np.arctan(p - 1 / G))  # 2/G in the map
        assert texel_angle(G, np.array(polar)) == pytest.approx(apart, rel=1e-3)


def test_a_lookup_gives_texels_back_and_is_linear_between():
    p = to_numpy(half_vector_texels(G, border=1)).T
    texels = mi.Float(
        np.stack([p[:, 0], p[:, 1], p[:, 0] - 2 * p[:, 1], 1 + 0 * p[:, 0]], axis=1).astype(np.float32).ravel()
    )
    turn = np.linspace(0, 2 * np.pi, 200)
    q = np.stack([np.cos(turn), np.sin(turn)], axis=1) * np.linspace(0, 1, 200)[:, None]
    found = to_numpy(lookup(texels, G, point(q))).T
    assert np.abs(found - np.stack([q[:, 0], q[:, 1], q[:, 0] - 2 * q[:, 1], 1 + 0 * q[:, 0]], axis=1)).max() < 1e-5


def test_an_even_light_stays_even_at_every_level_up_to_the_rim(rng):
    light = EnvironmentPyramid.of(np.full((64, 64, 3), 2.5, np.float32))
    shares = np.array([0.1, 0.3, 0.05, 0.2, 0.35])
    assert np.abs(at(facet_light(light, shares), cap(rng, 2000, 0.0)) / 2.5 - 1).max() < 2e-6


@pytest.mark.parametrize("level", range(LEVELS))
@pytest.mark.parametrize("degree", [2, 4])
def test_a_level_is_as_blurred_as_it_says(level, degree):
    """A harmonic around the viewer, head-on: there facets mirror to twice their angle, with twice their spread.

    Its second moment is all that counts where the blur is narrow; a wide one sees it to an angle of 60°.
    """
    axis = view_frame(VIEW)[:, 2]
    light = EnvironmentPyramid.of(picture(lambda d: 1 + 0.5 * legendre(degree, d @ axis)))
    found = at(facet_light(light, np.arange(LEVELS) == level), np.array([[0.0, 0.0, 1.0]]))[0]
    variance = 4 * level_variances()[level] * float(texel_angle(G, np.array(0.0))) ** 2
    damping = np.exp(-degree * (degree + 1) * variance / 2)
    assert found == pytest.approx([1 + 0.5 * damping] * 3, abs=0.01 + 0.1 * (1 - damping) * 0.5)


@pytest.mark.parametrize("levels", [[1, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1], [1, 0, 0, 0, 2]])
def test_weights_that_do_not_change_need_no_balance(levels):
    """Nor is any light lost at the rim, beyond which no facet is seen."""
    for resolution in (96, 112, 256):
        factors = balance(weights(levels), resolution).numpy().reshape(-1, 4)[:, :3]
        assert np.abs(factors - 1).max() < 1e-5


def test_widths_double_from_level_to_level():
    variances = level_variances()
    assert variances[2:] / variances[1:-1] == pytest.approx(np.full(LEVELS - 2, 4.0), rel=0.15)
    assert (np.diff(variances) > 0).all()


def test_levels_add_up(rng):
    """A weighted sum of levels is the sum of what each gives."""
    light = EnvironmentPyramid.of(
        picture(lambda d: 1 + d @ np.array([[0.3, 0.1, -0.4], [0.2, 0.5, 0.0], [-0.1, 0.0, 0.6]]))
    )
    shares, n = np.array([0.4, 0.0, 1.5, 0.2, 0.7]), cap(rng, 500, 0.0)
    together = at(facet_light(light, shares), n)
    apart = sum(share * at(facet_light(light, np.arange(LEVELS) == k), n) for k, share in enumerate(shares))
    # Each level is looked up anew on its way down to the first: a little more blurred where its weight is left in
    assert np.abs(together - apart).max() < 1e-4


def test_a_lean_looks_toward_the_middle():
    """The factor on the radius: with one half the light at a facet is that of the facet half as far out."""
    light = EnvironmentPyramid.of(picture(lambda d: 1 + 0.5 * d[:, 0] + 0.3 * d[:, 1]))
    frame = mi.Matrix3f(view_frame(VIEW).astype(np.float32))
    one = np.array([[1.0, 1.0, 1.0]])
    half, whole = (
        [CosineTable.of(np.hstack([(k == 0) * one, [[factor]]]).repeat(5, axis=0)) for k in range(LEVELS)]
        for factor in (0.5, 1.0)
    )
    p = np.array([[0.6, 0.2], [-0.3, 0.7], [0.1, -0.8]])
    leaning, upright = (
        to_numpy(lookup(gathered(frame, light, table, balance(table, G), G), G, point(q))).T[:, :3]
        for table, q in ((half, p), (whole, p / 2))
    )
    assert np.abs(leaning - upright).max() < 2e-3

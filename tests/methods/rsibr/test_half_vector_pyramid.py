"""The facet pyramid: each level is the mirrored light through a Gaussian of the stated width; together their sum."""

from itertools import pairwise

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.half_vector_map import half_vector_point, half_vector_texels
from rsibr.methods.rsibr.half_vector_pyramid import (
    LADDER,
    HalfVectorPyramid,
    balance,
    balanced,
    level_places,
    level_variances,
    lookup,
    lookup_variances,
    taps,
    texel_angle,
)
from tests.arrays import point, to_numpy, vector
from tests.light.test_environment_pyramid import legendre, picture

G = 96
LEVELS = len(LADDER)
FIRST = LADDER[0][1]
"""Variance of level 0 before lookups, by the blur of the light itself."""

VIEW = np.array([1.0, 2.0, 3.0])


def weights(levels):
    """Tables that give each level one weight at all angles."""
    return [CosineTable.of(np.tile([w, w, w, 1.0], (5, 1))) for w in levels]


def facet_light(light, levels):
    frame = mi.Matrix3f(view_frame(VIEW).astype(np.float32))
    tables = weights(levels)
    return balanced(HalfVectorPyramid.of(frame, light, G), tables, balance(tables, G))


def one_hot(level):
    return weights(np.arange(LEVELS) == level)


def at(texels, n):
    return to_numpy(lookup(texels, half_vector_point(vector(n)), G)).T[:, :3]


def cap(rng, count, least):
    """Unit normals in the map's frame with z above `least`."""
    z = rng.uniform(least, 1, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


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
    found = to_numpy(lookup(texels, point(q), G)).T
    assert np.abs(found - np.stack([q[:, 0], q[:, 1], q[:, 0] - 2 * q[:, 1], 1 + 0 * q[:, 0]], axis=1)).max() < 1e-5


@pytest.mark.parametrize(("before", "after"), list(pairwise(LADDER)))
def test_taps_have_the_variance_that_a_level_adds(before, after):
    """In texels of the finer level; symmetric, around a texel or, to half the side, between two."""
    kernel = taps(before, after)
    place = np.arange(len(kernel)) - (len(kernel) - 1) / 2
    assert kernel.sum() == pytest.approx(1, abs=1e-12)
    assert kernel == pytest.approx(kernel[::-1], abs=1e-12)
    assert kernel @ place**2 * 4.0 ** before[0] == pytest.approx(after[1] - before[1], rel=1e-9)
    assert len(kernel) % 2 == (after[0] == before[0])
    assert kernel.min() > 0


def test_the_collapsed_levels_are_root_two_apart_in_width():
    assert level_variances()[1:] / level_variances()[:-1] == pytest.approx(np.full(LEVELS - 1, 2.0), rel=1e-12)
    assert level_variances()[0] == pytest.approx(FIRST + 1 / 6, rel=1e-12)


def over(side, values):
    """A pyramid over the texels of a map, (M, 2) of texels from the centre → (M, 3)."""
    p = to_numpy(half_vector_texels(side, border=1)).T * side / 2
    return HalfVectorPyramid._over(
        mi.Float(np.hstack([values(p), np.ones((len(p), 1))]).astype(np.float32).ravel()), side
    )


def near_centre(rng, count, reach):
    return rng.uniform(-reach, reach, (count, 2))


def parabolas(p):
    """A blur adds its variance along either axis to a square, and nothing to a constant."""
    return np.stack([p[:, 0] ** 2, p[:, 1] ** 2, np.ones(len(p))], axis=1)


SIDE = 384
"""Texels a side where the widest level is far from the rim: 10 standard deviations."""


@pytest.mark.parametrize("level", range(LEVELS))
@pytest.mark.parametrize(("factor", "own_lookup"), [(0.618, 1 / 6), (1.0, 0.0)])
def test_the_variance_of_a_level_is_that_of_its_point_response(level, factor, own_lookup, rng):
    """Second moment of the response, lookups and collapse included, averaged over places between the texels.

    Without a lean a level is looked up at its own texels, which adds nothing; with one it is wider than it says.
    """
    p = near_centre(rng, 8000, 90)
    lean = [CosineTable.of(np.tile([w, w, w, factor], (5, 1))) for w in np.arange(LEVELS) == level]
    collapsed = mi.Float(to_numpy(over(SIDE, parabolas).collapsed(lean)).T.astype(np.float32).ravel())
    found = to_numpy(lookup(collapsed, point(2 * p / SIDE), SIDE)).T
    assert found[:, 2] == pytest.approx(np.ones(len(p)), abs=1e-4)
    measured = (found[:, :2] - (factor * p) ** 2).mean(axis=0) + FIRST
    halvings, variance = LADDER[level]
    later = level_variances()[level] - variance  # lookups in finer levels, and the last
    wanted = variance + own_lookup * 4.0**halvings + later * factor**2
    assert measured == pytest.approx([wanted] * 2, rel=0.005)


@pytest.mark.parametrize("level", range(LEVELS))
def test_the_variance_of_a_lookup_in_a_level_is_that_of_its_point_response(level, rng):
    p = near_centre(rng, 4000, 32)
    starts, sides = level_places(SIDE)
    places = point(2 * p / SIDE), mi.UInt32(starts[level]), mi.UInt32(sides[level])
    found = to_numpy(over(SIDE, parabolas).light(*places)).T
    measured = (found[:, :2] - p**2).mean(axis=0) + FIRST
    assert measured == pytest.approx([lookup_variances()[level]] * 2, rel=0.01)


@pytest.mark.parametrize("level", range(1, LEVELS))  # level 0 is the light as it is
def test_the_point_response_of_a_level_is_nearly_a_gaussian(level):
    """An impulse in one texel, against a Gaussian of its variance: half the L1 distance, at the texels."""
    side = 192
    collapsed = over(side, lambda p: np.isclose(p, 0.5, atol=1e-3).all(axis=1)[:, None] * np.ones((1, 3))).collapsed(
        one_hot(level)
    )
    found = to_numpy(collapsed)[0]
    p = to_numpy(half_vector_texels(side, border=1)).T * side / 2
    variance = level_variances()[level] - FIRST - 1 / 6  # of neither the light's blur nor the last lookup
    exact = np.exp(-0.5 * ((p - 0.5) ** 2).sum(axis=1) / variance)
    distance = np.abs(found / found.sum() - exact / exact.sum()).sum() / 2
    assert distance < (0.1 if level == 1 else 0.06)


def test_an_even_light_stays_even_at_every_level_up_to_the_rim(rng):
    light = EnvironmentPyramid.of(np.full((64, 64, 3), 2.5, np.float32))
    shares = rng.random(LEVELS)
    shares /= shares.sum()
    assert np.abs(at(facet_light(light, shares), cap(rng, 2000, 0.0)) / 2.5 - 1).max() < 2e-6
    pyramid = HalfVectorPyramid.of(mi.Matrix3f(view_frame(VIEW).astype(np.float32)), light, G)
    for start, side in zip(*level_places(G), strict=True):
        found = pyramid.light(half_vector_point(vector(cap(rng, 500, 0.0))), mi.UInt32(start), mi.UInt32(side))
        assert np.abs(to_numpy(found) / 2.5 - 1).max() < 2e-6


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


@pytest.mark.parametrize("levels", [[0], [2], [9], [0, 4, 4, 7]])
def test_weights_that_do_not_change_need_no_balance(levels):
    """Nor is any light lost at the rim, beyond which no facet is seen."""
    for resolution in (96, 112, 192):
        factors = balance(weights(np.bincount(levels, minlength=LEVELS)), resolution).numpy().reshape(-1, 4)[:, :3]
        assert np.abs(factors - 1).max() < 1e-5


def test_levels_add_up(rng):
    """A weighted sum of levels is the sum of what each gives."""
    light = EnvironmentPyramid.of(
        picture(lambda d: 1 + d @ np.array([[0.3, 0.1, -0.4], [0.2, 0.5, 0.0], [-0.1, 0.0, 0.6]]))
    )
    shares, n = np.array([0.4, 0.0, 1.5, 0.2, 0.7, 0.0, 0.3, 0.1, 0.0, 0.6]), cap(rng, 500, 0.0)
    together = at(facet_light(light, shares), n)
    apart = sum(share * at(facet_light(light, np.arange(LEVELS) == k), n) for k, share in enumerate(shares))
    # Each level is looked up anew on its way down to the first: a little more blurred where its weight is left in
    assert np.abs(together - apart).max() < 1e-4


def test_a_lean_looks_toward_the_middle():
    """The factor on the radius: with one half the light at a facet is that of the facet half as far out."""
    light = EnvironmentPyramid.of(picture(lambda d: 1 + 0.5 * d[:, 0] + 0.3 * d[:, 1]))
    pyramid = HalfVectorPyramid.of(mi.Matrix3f(view_frame(VIEW).astype(np.float32)), light, G)
    one = np.array([[1.0, 1.0, 1.0]])
    half, whole = (
        [CosineTable.of(np.hstack([(k == 0) * one, [[factor]]]).repeat(5, axis=0)) for k in range(LEVELS)]
        for factor in (0.5, 1.0)
    )
    p = np.array([[0.6, 0.2], [-0.3, 0.7], [0.1, -0.8]])
    leaning, upright = (
        to_numpy(lookup(balanced(pyramid, table, balance(table, G)), point(q), G)).T[:, :3]
        for table, q in ((half, p), (whole, p / 2))
    )
    assert np.abs(leaning - upright).max() < 2e-3

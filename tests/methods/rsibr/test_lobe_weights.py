"""Shares of the pyramid's levels: all of a lobe's albedo, with the variance of its facets."""

import numpy as np
import pytest

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.facet_moments import NODES, cosines, facet_moments
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.methods.rsibr.half_vector_pyramid import LEVELS, level_variances, texel_angle
from rsibr.methods.rsibr.lobe_weights import albedo_at_nodes, lobe_weights

G = 96
NOTHING = Gaussians(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


def one_gaussian(sigma):
    one = np.ones((1, 3))
    return LobeShape(sigma, Gaussians(np.array([sigma]), one, 0 * one), NOTHING, np.zeros((2, 3)))


def ggx(alpha):
    return LobeShape.of(ProxyLobe((alpha,), (np.ones((1, 3)),)))


def albedo_table():
    """Another over the angle in each channel; black in none."""
    c = node_cosines()
    return np.stack([0.9 * np.ones_like(c), 0.1 + 0.9 * (1 - c) ** 5, 0.3 + 0.5 * c], axis=1)


LOBES = {
    "narrow": [(ggx(0.005), albedo_table())],
    "rough": [(ggx(0.2), albedo_table())],
    "coat over flakes": [(ggx(0.015), albedo_table()), (ggx(0.3), 0.5 * albedo_table())],
    "mirror": [(LobeShape.mirror(), albedo_table())],
}


@pytest.mark.parametrize("name", LOBES)
def test_shares_add_up_to_the_albedo_of_all_lobes(name):
    """At every angle and in every channel; none is negative."""
    weights = lobe_weights(LOBES[name], G)
    total = weights.levels[..., :3].sum(axis=0) + weights.sharp[:, :3]
    wanted = sum(albedo_at_nodes(albedo) for _, albedo in LOBES[name])
    assert np.abs(total / wanted - 1).max() < 1e-12
    assert weights.levels[..., :3].min() >= 0
    assert weights.sharp[:, :3].min() >= 0


@pytest.mark.parametrize("sigma", [0.05, 0.12, 0.3])
def test_levels_are_mixed_to_the_variance_of_the_facets(sigma):
    kernel = one_gaussian(sigma)
    weights = lobe_weights([(kernel, np.ones((len(node_cosines()), 3)))], G)
    (moments,) = facet_moments(kernel)
    wanted = (moments.width / texel_angle(G, np.arccos(cosines()))) ** 2
    found = level_variances() @ weights.levels[..., 0]
    held = (wanted >= level_variances()[0]) & (wanted <= level_variances()[-1])
    assert held.sum() > NODES / 2
    assert found[held] == pytest.approx(wanted[held], rel=1e-9)


def test_what_is_narrower_than_a_texel_is_sharp():
    weights = lobe_weights(LOBES["mirror"], G)
    assert weights.has_sharp
    assert weights.sharp[:, :3] == pytest.approx(albedo_at_nodes(albedo_table()), rel=1e-3)
    assert weights.sharp[:, 3].max() < 1e-3
    half = lobe_weights([(one_gaussian(0.02), albedo_table())], G)  # of texels of 0.042
    assert 0 < half.sharp[-1, 0] < half.levels[0, -1, 0]
    assert half.sharp[-1, 3] == pytest.approx(0.02, rel=0.05)
    assert not lobe_weights([(one_gaussian(0.2), albedo_table())], G).has_sharp


def test_neighbouring_levels_share_a_gaussian():
    weights = lobe_weights([(one_gaussian(0.2), np.ones((len(node_cosines()), 3)))], G)
    assert ((weights.levels[..., 0] > 1e-9).sum(axis=0) <= 2).all()
    assert weights.levels.shape == (LEVELS, NODES, 4)


def test_radii_shrink_by_the_lean_of_the_facets():
    kernel = one_gaussian(0.2)
    weights = lobe_weights([(kernel, np.ones((len(node_cosines()), 3)))], G)
    (moments,) = facet_moments(kernel)
    angle = np.arccos(cosines())[:-1]
    level = weights.levels[..., 0].argmax(axis=0)[:-1]
    factors = weights.levels[level, np.arange(NODES - 1), 3]
    leaning = np.maximum(angle - moments.lean[:-1], 0)
    assert factors == pytest.approx(np.tan(leaning / 2) / np.tan(angle / 2), rel=1e-6)
    assert factors.max() <= 1 + 1e-9


def test_an_albedo_at_the_nodes_is_its_table_interpolated():
    """Both tables are even in √cos θ, 65 nodes and 33: every other node is one but for the most grazing."""
    table = albedo_table()
    assert albedo_at_nodes(table)[2:] == pytest.approx(table[4::2], rel=1e-9)

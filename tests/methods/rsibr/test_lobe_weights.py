"""Shares of the pyramid's levels: all of a lobe's albedo, with the variance of its facets."""

import numpy as np
import pytest

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.facet_moments import NODES, cosines, facet_moments
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.lobe_terms import WIDE, LobeTerms, albedo_at_nodes
from rsibr.methods.rsibr.half_vector_pyramid import LADDER, level_variances, texel_angle
from rsibr.methods.rsibr.lobe_weights import _mixture, lobe_weights
from tests.lobe_shapes import coated, fresnel, ggx, matte, one_gaussian

G = 96
LEVELS = len(LADDER)
WHITE = np.ones((len(node_cosines()), 3))


def albedo_table():
    """Another over the angle in each channel; black in none."""
    c = node_cosines()
    return np.stack([0.9 * np.ones_like(c), 0.1 + 0.9 * (1 - c) ** 5, 0.3 + 0.5 * c], axis=1)


LOBES = {
    "narrow": [(ggx(0.02), albedo_table())],
    "rough": [(ggx(0.3), albedo_table())],
    "dielectric over flakes": [(fresnel(0.1), albedo_table()), (coated(0.3), 0.5 * albedo_table())],
    "matte and mirror": [(matte(), albedo_table()), (LobeShape.mirror(), 0.3 * albedo_table())],
}


def weights_of(lobes, part=None):
    terms = LobeTerms.of(lobes)
    return lobe_weights(terms.narrow, LobeTerms.of(lobes, part).narrow, G), terms


@pytest.mark.parametrize("name", LOBES)
def test_shares_add_up_to_the_albedo_of_all_lobes(name):
    """At every angle and in every channel: levels, what is narrower, what is wide, and what is matte."""
    weights, terms = weights_of(LOBES[name])
    total = weights.levels[..., :3].sum(axis=0)
    total += sum(fraction[:, None] * term.share for fraction, term in zip(weights.sharp, terms.narrow, strict=True))
    total += sum(term.share for term in [*terms.wide, *terms.matte])
    wanted = sum(albedo_at_nodes(albedo) for shape, albedo in LOBES[name] if not shape.is_mirror)
    assert np.abs(total / wanted - 1).max() < 1e-12
    assert all((term.share >= 0).all() for term in [*terms.gaussians, *terms.matte])
    assert all(term.sigma < WIDE for term in terms.narrow)
    assert all(term.sigma >= WIDE for term in terms.wide)


def test_shares_of_a_lobe_are_as_the_energies_of_its_terms():
    """P_k = E_k Σ (u_kj / Σ u_kj) Λ_kj, whatever the scale of the fit."""
    shape = fresnel(0.1)
    terms = LobeTerms.of([(shape, albedo_table())]).gaussians
    energy = np.stack([moments.weight for moments in facet_moments(shape)])
    wanted = albedo_at_nodes(albedo_table()) * energy / energy.sum(axis=0)
    assert np.stack([term.share for term in terms]) == pytest.approx(wanted, rel=1e-12)
    doubled = LobeTerms.of([(shape.tinted(np.array([2.0, 3.0, 0.5])), albedo_table())]).gaussians
    assert np.stack([term.share for term in doubled]) == pytest.approx(wanted, rel=1e-12)


def test_parts_have_shares_of_their_own_and_radii_of_the_whole():
    lobes = LOBES["dielectric over flakes"]
    whole, _ = weights_of(lobes)
    parts = [weights_of(lobes, shape)[0] for shape, _ in lobes]
    assert sum(part.levels[..., :3] for part in parts) == pytest.approx(whole.levels[..., :3], abs=1e-14)
    for part in parts:
        assert np.array_equal(part.levels[..., 3], whole.levels[..., 3])
        assert np.array_equal(part.sharp, whole.sharp)


@pytest.mark.parametrize("sigma", [0.05, 0.09])
def test_levels_are_mixed_to_the_variance_of_the_facets(sigma):
    shape = one_gaussian(sigma)
    weights, _ = weights_of([(shape, WHITE)])
    (moments,) = facet_moments(shape)
    wanted = (moments.width / texel_angle(G, np.arccos(cosines()))) ** 2
    found = level_variances() @ weights.levels[..., 0]
    held = (wanted >= level_variances()[0]) & (wanted <= level_variances()[-1])
    assert held.sum() > NODES / 2
    assert found[held] == pytest.approx(wanted[held], rel=1e-9)


def test_what_is_narrower_than_a_texel_is_sharp():
    weights, _ = weights_of([(one_gaussian(0.01), albedo_table())])
    assert weights.sharp == pytest.approx(np.ones((1, NODES)))
    assert not weights.has_levels
    half, _ = weights_of([(one_gaussian(0.0287), WHITE)])  # of texels of 0.042
    assert 0 < half.sharp[0, -1] < 1
    assert half.sharp[0, -1] == pytest.approx(1 - half.levels[:, -1, 0].sum(), abs=1e-12)
    assert not weights_of([(one_gaussian(0.09), WHITE)])[0].sharp.any()


def test_sharp_fractions_fall_from_eight_tenths_of_the_first_level_to_all_of_it():
    """By the variance, linearly."""
    head_on = texel_angle(G, np.array(0.0)) * np.sqrt(level_variances()[0])
    for ratio, fraction in ((0.78, 1.0), (0.92, 0.5), (1.05, 0.0)):
        weights, _ = weights_of([(one_gaussian(float(head_on) * np.sqrt(ratio)), WHITE)])
        assert weights.sharp[0, -1] == pytest.approx(fraction, abs=0.06), ratio


def test_a_texel_of_the_map_widens_every_gaussian():
    """By the variance of its box filter; the levels serve what is wider than so many texels."""
    (term,) = LobeTerms.of([(one_gaussian(0.05), WHITE)]).narrow
    texel = 1e-3
    wanted = (term.moments.width**2 + texel) / texel_angle(G, np.arccos(cosines())) ** 2
    weights = lobe_weights([term], [term], G, texel)
    held = (wanted >= level_variances()[0]) & (wanted <= level_variances()[-1])
    assert held.sum() > NODES / 2
    assert (level_variances() @ weights.levels[..., 0])[held] == pytest.approx(wanted[held], rel=1e-9)
    ratio = term.moments.width[-1] ** 2 / texel  # 2.5 head-on
    for least, sharp in {0.9 * ratio: 0.0, ratio / 0.9: 0.5, 2 * ratio: 1.0}.items():
        assert lobe_weights([term], [term], G, texel, least).sharp[0, -1] == pytest.approx(sharp, abs=1e-9)


def test_three_neighbouring_levels_share_a_gaussian():
    weights, _ = weights_of([(one_gaussian(0.09), WHITE)])
    used = np.abs(weights.levels[..., 0]) > 1e-12
    assert (used.sum(axis=0) <= 3).all()
    assert (used.sum(axis=0) >= 2).any()
    first, last = used.argmax(axis=0), LEVELS - 1 - used[::-1].argmax(axis=0)
    assert (last - first <= 2).all()
    assert weights.levels.shape == (LEVELS, NODES, 4)


def distance(variance, steps, weights):
    """∫ (Σ w_i g_i − g)² over the plane, relative to ∫ g², by the overlap 1/(2π (a + b)) of two Gaussians."""
    a, w = np.concatenate([steps, [variance]]), np.concatenate([weights, [-1.0]])
    return w @ (1 / (a[:, None] + a)) @ w * 2 * variance


def test_mixtures_keep_weight_and_variance_and_are_nearer_than_two_levels():
    steps = level_variances()
    variances = np.geomspace(steps[0], steps[-1], 200)
    mixtures = _mixture(variances, steps).T
    assert mixtures.sum(axis=1) == pytest.approx(np.ones(200), rel=1e-12)
    assert mixtures @ steps == pytest.approx(variances, rel=1e-12)
    for variance, mixture in zip(variances, mixtures, strict=True):
        low = min(np.searchsorted(steps, variance, side="right") - 1, LEVELS - 2)
        high = (variance - steps[low]) / (steps[low + 1] - steps[low])
        two = np.zeros(LEVELS)
        two[[low, low + 1]] = 1 - high, high
        assert distance(variance, steps, mixture) <= distance(variance, steps, two) + 1e-12
    middle = _mixture(np.array([1.5 * steps[4]]), steps)[:, 0]
    assert distance(1.5 * steps[4], steps, middle) < 0.003  # two levels: 0.005, and an eighth too high in the middle
    assert abs(distance(steps[4], steps, _mixture(steps[4:5], steps)[:, 0])) < 1e-12


def test_a_mixture_is_the_best_of_its_three_levels():
    """Any other weights that keep sum and variance are farther from the Gaussian."""
    steps = level_variances()
    variance = 1.4 * steps[3]
    best = _mixture(np.array([variance]), steps)[:, 0]
    first, second, third = steps[np.flatnonzero(best)]
    free = np.zeros(LEVELS)
    free[np.flatnonzero(best)] = np.array([third - second, first - third, second - first]) / third
    for step in (-0.05, 0.05):
        assert distance(variance, steps, best + step * free) > distance(variance, steps, best)


def test_radii_shrink_by_the_lean_of_the_facets():
    shape = one_gaussian(0.09)
    weights, _ = weights_of([(shape, WHITE)])
    (moments,) = facet_moments(shape)
    angle = np.arccos(cosines())[:-1]
    level = np.abs(weights.levels[..., 0]).argmax(axis=0)[:-1]
    factors = weights.levels[level, np.arange(NODES - 1), 3]
    leaning = np.maximum(angle - moments.lean[:-1], 0)
    assert factors == pytest.approx(np.tan(leaning / 2) / np.tan(angle / 2), rel=1e-6)
    assert factors.max() <= 1 + 1e-9


def test_an_albedo_at_the_nodes_is_its_table_interpolated():
    """Both tables are even in √cos θ, 65 nodes and 33: every other node is one but for the most grazing."""
    table = albedo_table()
    assert albedo_at_nodes(table)[2:] == pytest.approx(table[4::2], rel=1e-9)

"""Footprints of narrow Gaussians: one for all, or one for each few, with the variance of those that share it."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.facet_moments import NODES, cosines
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.methods.lobe_terms import LobeTerms
from rsibr.methods.rsibr.narrow_gaussians import NarrowGaussians, _groups
from tests.arrays import to_numpy
from tests.lobe_shapes import NO_MATTE, ggx, one_gaussian
from tests.methods.rsibr.test_anisotropic_footprint import shading, squared_angles

ONE = np.ones((len(node_cosines()), 3))
SIGMAS = np.array([0.004, 0.012, 0.02])
SHARES = np.array([0.5, 0.3, 0.2])
NODE = 24
"""Of the angle that is looked at, where no table is interpolated."""


def three():
    weights = SHARES[:, None] * np.ones((3, 3))
    return LobeShape(0.02, Gaussians(SIGMAS, weights, 0 * weights), Gaussians.none(), NO_MATTE)


def terms(shape, albedo=ONE):
    return LobeTerms.of([(shape, albedo)]).narrow


def spread(made, cosine):
    """Variances of the light's places in the plane of incidence and across it, blurs included, over the light."""
    surface, squared = squared_angles(cosine)
    light = to_numpy(made.radiance(surface, mi.Float(0), squared))[:2, 0]
    return light / to_numpy(made.radiance(surface, mi.Float(0), lambda _d, _width: mi.Color3f(1)))[0, 0]


@pytest.mark.parametrize("ratio", [np.inf, 1.6, 1.0])
def test_footprints_have_the_variance_of_their_gaussians(ratio):
    """Twice the slopes in the plane of incidence; across it twice their cosine."""
    cosine = float(cosines()[NODE])
    made = NarrowGaussians.of(terms(three()), terms(three()), ratio=ratio)
    variance = SHARES @ SIGMAS**2
    along, across = spread(made, cosine)
    assert along == pytest.approx(4 * variance, rel=0.04)
    assert across == pytest.approx(4 * variance * cosine**2, rel=0.04)
    assert made.is_single == np.isinf(ratio)
    assert to_numpy(made.count)[0] == (1 if np.isinf(ratio) else 3)


def test_gaussians_share_a_footprint_up_to_a_ratio_of_their_widths():
    both = [one_gaussian(s, 0.1) for s in (0.01, 0.015, 0.02, 0.05)] + [one_gaussian(0.012, 0.1, under_coat=True)]
    found = [terms(shape)[0] for shape in both]
    assert _groups(found, [0, 1, 2, 3, 4], 1.6) == [[0, 1], [2], [3], [4]]
    assert _groups(found, [3, 2, 1, 0], 2.0) == [[0, 1, 2], [3]]
    assert _groups(found, [0, 1, 2, 3, 4], np.inf) == [[0, 1, 2, 3, 4]]
    assert _groups(found, [], 1.6) == []


@pytest.mark.parametrize("ratio", [np.inf, 1.6])
def test_an_even_light_is_reflected_as_the_shares_say(ratio):
    """Under a light of 1: the part of each Gaussian that is gathered, in each channel."""
    albedo = np.stack([node_cosines(), 0.5 + 0 * node_cosines(), 1 - 0.5 * node_cosines()], axis=1)
    found = terms(ggx(0.02), albedo)
    fractions = np.linspace(0.1, 1, len(found))[:, None] * np.ones((1, NODES))
    made = NarrowGaussians.of(found, found, fractions, ratio=ratio)
    cosine = cosines()[NODE]
    light = to_numpy(made.radiance(shading(float(cosine)), mi.Float(0), lambda _d, _w: mi.Color3f(1)))[:, 0]
    wanted = sum(f[NODE] * term.share[NODE] for f, term in zip(fractions, found, strict=True))
    assert light == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("ratio", [np.inf, 1.6])
def test_a_part_is_gathered_where_the_whole_is(ratio):
    """The widths are those of all lobes, the shares those of one."""
    lobes = [(one_gaussian(0.004, 0.02), 0.3 * ONE), (one_gaussian(0.005, 0.02), 0.6 * ONE)]
    whole = LobeTerms.of(lobes).narrow
    surface = shading(0.5)

    def sharp(d, width):
        return mi.Color3f(dr.exp(10 * d.x), d.z * d.z, width)

    def light(part):
        made = NarrowGaussians.of(whole, LobeTerms.of(lobes, part).narrow, ratio=ratio)
        return to_numpy(made.radiance(surface, mi.Float(0), sharp))[:, 0]

    assert sum(light(shape) for shape, _ in lobes) == pytest.approx(light(None), rel=1e-5)


def test_there_is_nothing_to_gather_of_what_the_levels_hold():
    found = terms(ggx(0.02))
    assert NarrowGaussians.of(found, found, np.zeros((len(found), NODES)), ratio=np.inf) is None
    assert NarrowGaussians.of([], [], ratio=1.6) is None

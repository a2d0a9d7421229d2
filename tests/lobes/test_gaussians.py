"""Gaussians of slopes have the shape of the lobes that they stand for, tails included."""

import numpy as np
import pytest

from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import LobeShape

PLAIN = np.ones((1, 3))


def lobe(*terms):
    """A glossy lobe of (roughness, coefficients of shape (terms, 3))."""
    return LobeShape.of(ProxyLobe(tuple(a for a, _ in terms), tuple(c for _, c in terms)))


def density(slope, sigmas, weights):
    """Of slopes, for one channel's weights."""
    return (np.exp(-0.5 * (slope[:, None] / sigmas) ** 2) / (2 * np.pi * sigmas**2)) @ weights


def ggx_density(slope, alpha):
    return alpha**2 / (np.pi * (alpha**2 + slope**2) ** 2)


@pytest.mark.parametrize("alpha", [0.01, 0.05, 0.2, 0.5])
def test_a_mixture_has_the_density_of_ggx(alpha):
    """Over four decades: from the core to slopes of 1, 45° off the normal; roughly on to 3, where it carries 1e-3."""
    bare = lobe((alpha, PLAIN)).bare
    slope = np.geomspace(0.1 * alpha, min(3, 30 * alpha), 500)
    error = np.abs(density(slope, bare.sigmas, bare.plain[:, 1]) / ggx_density(slope, alpha) - 1)
    assert error[slope < 1].max() < (0.06 if alpha < 0.4 else 0.1)
    assert error.max() < 0.2
    assert error.mean() < 0.04
    assert bare.plain.sum(axis=0) == pytest.approx([1] * 3, abs=0.02 + 0.15 * alpha**2)  # steeper ones are cut off
    assert not bare.grazing.any()


def test_a_sum_of_lobes_is_a_sum_of_densities():
    kernel = lobe((0.03, 2 * PLAIN), (0.15, 0.5 * PLAIN))
    slope = np.geomspace(3e-3, 0.9, 500)
    wanted = 2 * ggx_density(slope, 0.03) + 0.5 * ggx_density(slope, 0.15)
    assert np.abs(density(slope, kernel.bare.sigmas, kernel.bare.plain[:, 0]) / wanted - 1).max() < 0.12


def test_terms_stay_apart():
    """Plain, grazing and coated coefficients go where they belong, channel by channel."""
    colours = np.diag([1.0, 2.0, 3.0])
    kernel = lobe((0.2, colours))
    assert kernel.bare.plain.sum(axis=0) == pytest.approx([1, 0, 0], rel=0.02, abs=1e-9)
    assert kernel.bare.grazing.sum(axis=0) == pytest.approx([0, 2, 0], rel=0.02, abs=1e-9)
    assert kernel.coated.plain.sum(axis=0) == pytest.approx([0, 0, 3], rel=0.02, abs=1e-9)
    assert not kernel.coated.grazing.any()
    assert not kernel.is_matte


def test_a_lobe_of_a_wide_roughness_has_but_one_term():
    kernel = lobe((0.2, np.ones((2, 3))), (0.8, PLAIN))
    assert not len(kernel.coated.sigmas)
    assert kernel.bare.grazing.any()


def test_a_matte_lobe_is_its_cosine_lobes():
    coefficients = np.array([[0.5, 0.1, 0.0], [0.2, 0.0, 0.3]])
    kernel = LobeShape.of(ProxyLobe((LAMBERT,), (coefficients,)))
    assert kernel.is_matte
    assert np.array_equal(kernel.matte, coefficients)
    assert not len(kernel.bare.sigmas)
    assert not len(kernel.coated.sigmas)


def test_a_mirror_has_facets_without_slope():
    kernel = LobeShape.mirror()
    assert not kernel.is_matte
    assert np.array_equal(kernel.bare.sigmas, [0])
    assert np.array_equal(kernel.bare.plain, np.ones((1, 3)))


def test_between_takes_each_gaussian_once():
    bare = lobe((0.05, PLAIN)).bare
    parts = [bare.between(0, 0.12), bare.between(0.12, np.inf)]
    assert np.array_equal(np.concatenate([part.sigmas for part in parts]), bare.sigmas)
    assert np.array_equal(np.concatenate([part.plain for part in parts]), bare.plain)
    assert parts[0].sigmas.max() < 0.12 <= parts[1].sigmas.min()

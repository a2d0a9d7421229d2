"""The kernel against its definition and closed forms; the softened kernel."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.microfacet import ggx_density
from rsibr.methods.split_sum.ggx_kernel import GGXKernel, SoftenedKernel
from tests.methods.split_sum.lights import band_factors


@pytest.mark.parametrize("alpha", [0.03, 0.3, 1.0])
def test_it_is_the_weight_of_a_sampled_half_vector(alpha):
    """D (n·h) / (4 v·h) (n·l), with h between r = n = v and l."""
    angle = np.linspace(0.01, 2.5, 40)
    normal = np.array([0, 0, 1.0])
    light = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    half = (light + normal) / np.linalg.norm(light + normal, axis=1, keepdims=True)
    drawn = ggx_density(half[:, 2], alpha) * half[:, 2] / (4 * half @ normal)
    expected = drawn * np.maximum(light[:, 2], 0)
    np.testing.assert_allclose(GGXKernel(alpha).value(np.sin(angle / 2) ** 2), expected, rtol=1e-12, atol=1e-15)


def test_at_alpha_1_it_is_a_cosine_lobe():
    """D is constant: bands 1, 2/3, 1/4, 0, −1/24."""
    np.testing.assert_allclose(band_factors(1 - 1e-9, 5), [1, 2 / 3, 1 / 4, 0, -1 / 24], atol=1e-7)


def test_a_softened_kernel_is_the_kernel_outside_and_smooth_inside():
    kernel, radius = GGXKernel(0.05), 0.3
    plain, soft = SoftenedKernel.of(kernel, 0.0), SoftenedKernel.of(kernel, radius)
    angle = np.linspace(1e-3, 1.5, 2000)
    s = mi.Float(np.sin(angle / 2) ** 2)
    near = np.array(plain.at(s) - soft.at(s)) / np.array(plain.at(s))
    assert np.abs(near[angle > radius]).max() < 1e-5
    assert near.min() > -1e-5  # no negative part is summed in a window
    assert near[0] > 0.9  # and the peak is in the window
    slope = np.abs(np.diff(np.array(soft.at(s)), n=2))
    assert slope.max() < 1e-3 * float(np.array(soft.at(mi.Float(0))).item())
    assert dr.all(soft.at(s) > 0)


@pytest.mark.parametrize("radius", [0.0, 0.4])
def test_a_small_source_counts_by_its_variance(radius):
    """Against the mean over a ring of sources around a direction at angle θ."""
    kernel, width = SoftenedKernel.of(GGXKernel(0.2), radius), 0.03
    turn = (np.arange(64) + 0.5) * 2 * np.pi / 64
    for angle in (0.1, 0.3, 0.6, 1.3):
        middle, side = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
        ring = np.outer(np.cos(turn), side) + np.outer(np.sin(turn), [0, 1, 0])
        around = np.cos(width) * middle + np.sin(width) * ring
        s = mi.Float((1 - around[:, 2]) / 2)
        wanted = np.array(kernel.at(s) * (1 - 2 * s), dtype=np.float64).mean()
        found = kernel.mean_at(mi.Float((1 - np.cos(angle)) / 2), mi.Float(width**2 / 2))
        alone = kernel.mean_at(mi.Float((1 - np.cos(angle)) / 2), mi.Float(0))
        error, without = (abs(float(np.array(one).item()) - wanted) for one in (found, alone))
        assert error < 0.05 * without + 1e-4 * wanted

"""The kernel against its definition and closed forms; the softened kernel."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.microfacet import ggx_density
from rsibr.methods.split_sum.ggx_kernel import GGXKernel, SoftenedKernel


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
    np.testing.assert_allclose(GGXKernel(1 - 1e-9).band_factors(5), [1, 2 / 3, 1 / 4, 0, -1 / 24], atol=1e-7)


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

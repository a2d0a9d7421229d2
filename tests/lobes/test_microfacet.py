"""Terms of the microfacet model against their definitions, for NumPy and Dr.Jit arrays."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.microfacet import ggx_density, schlick, smith_denominator, transmitted

ALPHAS = [0.05, 0.3, 1.0]


@pytest.mark.parametrize("alpha", ALPHAS)
def test_projected_microfacets_cover_the_surface_once(alpha):
    """∫ D cos θ dω = 1 (Walter et al. 2007, section 4.1)."""
    angle = np.linspace(0, np.pi / 2, 200_001)
    integrand = ggx_density(np.cos(angle), alpha) * np.cos(angle) * np.sin(angle)
    assert 2 * np.pi * np.trapezoid(integrand, angle) == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_shadowing_is_that_of_smiths_lambda(alpha):
    """G₂ = 1/(1 + Λ_i + Λ_o) with Λ = (√(1 + α² tan² θ) − 1)/2 (Heitz 2014, eq. 72 and 99)."""
    cos_i, cos_o = np.linspace(0.01, 1, 40), np.linspace(1, 0.02, 40)

    def smith_lambda(cosine):
        return (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2

    got = 2 * cos_i * cos_o / smith_denominator(cos_i, cos_o, alpha, np)
    assert got == pytest.approx(1 / (1 + smith_lambda(cos_i) + smith_lambda(cos_o)), rel=1e-12)


def test_schlicks_term_is_clipped():
    assert schlick(np.array([-0.1, 0.0, 0.5, 1.0, 1.1]), np) == pytest.approx([1, 1, 0.5**5, 0, 0])
    assert transmitted(np.array([0.0, 1.0]), np) == pytest.approx([0, 1])


def test_drjit_and_numpy_agree():
    cosine = np.linspace(0.05, 1, 20)
    device = mi.Float(cosine.astype(np.float32))
    assert np.array(schlick(device)) == pytest.approx(schlick(cosine, np), abs=1e-6)
    assert np.array(ggx_density(device, 0.3)) == pytest.approx(ggx_density(cosine, 0.3), rel=1e-5)
    got = np.array(smith_denominator(device, device, 0.3))
    assert got == pytest.approx(smith_denominator(cosine, cosine, 0.3, np), rel=1e-6)

"""Fit of a material's lobes: lobes that are GGX are found again, and others have an error."""

import numpy as np
import pytest

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.microfacet import schlick
from rsibr.methods.split_sum.dfg import dfg
from rsibr.methods.split_sum.material_fit import disk_weights, fit_lobe, glossy_share, mean_error, nearest_alpha
from tests import lobe_shapes

WHITE = np.ones((len(node_cosines()), 3))


@pytest.mark.parametrize("alpha", [0.03, 0.1, 0.3])
def test_ggx_has_its_own_roughness(alpha):
    found, error = nearest_alpha(lobe_shapes.ggx(alpha))
    assert found == pytest.approx(alpha, rel=0.02)
    assert error < 0.02


def test_a_gaussian_is_told_from_ggx():
    """Head-on, GGX holds 1 − 1/(1 + q) and a Gaussian 1 − exp(−q α²/2σ²) of the light within a slope of α√q."""
    found, error = nearest_alpha(lobe_shapes.one_gaussian(0.05))
    assert 0.05 < found < 0.065
    assert 0.1 < error < 0.14


def test_reflectances_are_found_again():
    f0, f90 = np.array([0.9, 0.5, 0.04]), np.array([1.0, 0.8, 1.0])
    table = dfg(node_cosines(), np.array([nearest_alpha(lobe_shapes.ggx(0.1))[0]]))[0]
    fit = fit_lobe("metal", lobe_shapes.ggx(0.1), table @ np.stack([f0, f90]))
    np.testing.assert_allclose(fit.f0, f0, atol=1e-4)
    np.testing.assert_allclose(fit.f90, f90, atol=2e-3)
    np.testing.assert_allclose(fit.fitted, fit.exact, atol=1e-4)
    assert fit.albedo_error < 1e-4
    assert not fit.matte.any()


def test_an_albedo_of_another_form_has_an_error():
    wavy = (0.5 + 0.3 * np.sin(9 * node_cosines()))[:, None] * np.ones(3)
    fit = fit_lobe("odd", lobe_shapes.ggx(0.1), wavy)
    left = np.sqrt((disk_weights()[:, None] * (fit.fitted - wavy) ** 2).sum())
    assert fit.albedo_error == pytest.approx(left / np.sqrt((disk_weights()[:, None] * wavy**2).sum()))
    assert fit.error == fit.albedo_error > 0.1


def test_a_mirror_has_schlicks_albedo():
    cosines = node_cosines()[:, None]
    albedo = 0.04 + 0.96 * schlick(cosines, np) * np.ones(3)
    fit = fit_lobe("mirror", LobeShape.mirror(), albedo)
    assert fit.alpha == 0
    np.testing.assert_allclose([*fit.f0, *fit.f90], [0.04] * 3 + [1] * 3, atol=1e-6)
    assert fit.error < 1e-6


def test_a_matte_lobe_is_matte_and_a_mixture_is_shared_out():
    fit = fit_lobe("matte", lobe_shapes.matte((0.5, 0.2, 0.1), (0.0, 0.0, 0.3)), 0.4 * WHITE)
    np.testing.assert_allclose(fit.matte, 0.4 * WHITE)
    assert not fit.exact.any()
    glossy = lobe_shapes.one_gaussian(0.1)
    both = LobeShape(glossy.alpha, glossy.bare, Gaussians.none(), np.array([[0.5, 0.0, 2.0], [0, 0, 0]]))
    share = glossy_share(both)
    assert share[:, 1].min() == 1
    assert (share[-1, 0] > share[-1, 2]).all()
    np.testing.assert_allclose(share[-1, 0], 1 / 1.5, atol=0.02)  # a Gaussian reflects nearly all head-on


def test_weights_are_those_of_the_disk():
    weights = disk_weights()
    assert weights.sum() == pytest.approx(1)
    assert (weights * node_cosines()).sum() == pytest.approx(2 / 3, abs=1e-3)


def test_the_mean_error_is_weighted_by_albedo():
    wavy = (0.5 + 0.3 * np.sin(9 * node_cosines()))[:, None] * np.ones(3)
    odd, faint = (fit_lobe("odd", lobe_shapes.ggx(0.1), one) for one in (wavy, 1e-3 * wavy))
    even = fit_lobe("even", LobeShape.mirror(), 0.7 * WHITE)
    assert mean_error([odd]) == pytest.approx(odd.error)
    assert mean_error([faint, even]) < 0.002 * odd.error
    assert mean_error([]) == 0

"""Parameters found for materials that the model can describe, and the error where it cannot."""

import numpy as np
import pytest

from rsibr.lobes.albedo import node_cosines, over_disk
from rsibr.lobes.band_factors import gaussian, phong
from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.methods.kautz2003.box_factors import bias_for
from rsibr.methods.kautz2003.material_fit import KautzMaterial, Lobes, schlick_mix
from tests.lobe_shapes import one_gaussian as gaussian_shape

SIZE = 64
FLAT = np.ones((len(cosines()), 3))


def albedo(values):
    """Table of a lobe with the same directional albedo in each direction."""
    return np.ones((len(node_cosines()), 1)) * np.broadcast_to(values, (3,))


def test_a_material_of_the_model_is_found():
    f, k_d, k_s = np.array([0.05, 0.3, 0.7]), np.array([0.6, 0.2, 0.1]), np.array([1.0, 0.8, 0.5])
    fresnel = schlick_mix(f)
    fit = KautzMaterial.fitted(Lobes((1 - fresnel) * k_d, fresnel * k_s, phong(225.0)), SIZE)
    assert fit.f_lambda == pytest.approx(f, abs=2e-3)
    assert fit.k_d == pytest.approx(k_d, rel=0.02)
    assert fit.k_s == pytest.approx(k_s, rel=0.02)
    assert fit.exponent == pytest.approx(225, rel=0.01)
    assert fit.bias == pytest.approx(bias_for(phong(225.0), SIZE)[0])
    assert max(fit.albedo_error, fit.split_error, fit.phong_error) < 3e-3
    assert 0.03 < fit.box_error < 0.05


def test_a_matte_material_has_its_albedo_and_the_widest_glossy_lobe():
    """F takes from the diffuse part at grazing angles; a glossy part as bright puts it back."""
    matte = LobeShape(1.0, Gaussians.none(), Gaussians.none(), np.array([[0.5] * 3, [0.0] * 3]))
    fit = KautzMaterial.fitted(Lobes.of({"base": (matte, albedo(0.5))}), SIZE)
    assert fit.f_lambda == pytest.approx(0)
    assert fit.k_d == pytest.approx(0.5, abs=1e-4)
    assert fit.k_s == pytest.approx(0.5, abs=1e-4)
    assert fit.albedo_error < 1e-4
    assert fit.split_error > 0.1
    assert fit.exponent == pytest.approx(1, rel=0.01)


def test_a_mirror_has_no_blur_and_no_diffuse_part():
    lobes = Lobes.of({"mirror": (LobeShape.mirror(), albedo([0.9, 0.6, 0.3]))})
    fit = KautzMaterial.fitted(lobes, SIZE)
    assert fit.bias == 0
    assert fit.k_d == pytest.approx(0)
    assert (schlick_mix(fit.f_lambda) * fit.k_s)[-1] == pytest.approx([0.9, 0.6, 0.3], abs=0.02)
    # What is left is what the finest texels cannot show
    errors = [KautzMaterial.fitted(lobes, size).box_error for size in (64, 256, 1024)]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_the_width_is_twice_that_of_the_microfacets():
    """At normal incidence a half vector that turns by s turns the mirrored direction by 2s; less across the plane."""
    sigma = 0.05
    lobes = Lobes.of({"coat": (gaussian_shape(sigma), albedo(1.0))})
    weights = over_disk(FLAT[:, :1] * gaussian(2 * sigma * np.sqrt(cosines())), cosines())
    assert lobes.factors == pytest.approx(weights, abs=0.03)


def test_two_lobes_of_differing_width_say_that_one_cannot_stand_for_both():
    shapes = {"narrow": (gaussian_shape(0.01), albedo(0.2)), "wide": (gaussian_shape(0.3), albedo(0.4))}
    both = KautzMaterial.fitted(Lobes.of(shapes), SIZE)
    single = KautzMaterial.fitted(Lobes.of({"narrow": shapes["narrow"]}), SIZE)
    assert both.box_error > 3 * single.box_error
    assert both.phong_error > 0.2


def test_nothing_reflects_nothing():
    fit = KautzMaterial.fitted(Lobes(0 * FLAT, 0 * FLAT, phong(1.0)), SIZE)
    assert [fit.k_d.max(), fit.k_s.max(), fit.albedo_error] == [0, 0, 0]

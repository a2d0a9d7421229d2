"""A lobe's own shape: fits against the NumPy microfacets of `tests.microfacet` and Mitsuba, at held-out directions."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.bsdf_eval import reflected
from rsibr.lobes.probe_directions import probe_directions
from rsibr.lobes.shape_fit import NARROWEST, RATIO, WIDEST, angle_errors, shape_values, sigmas
from tests import lobe_shapes, microfacet

HELD_OUT = probe_directions(cosines=(0.95, 0.7, 0.5, 0.32, 0.18), draws=256, seed=99)
STEEP = 4
"""Index of the flattest of its views."""


def errors(shape, brdf):
    """∫ |f̂ − f| over ∫ f at each of the five view angles; half of it is light gathered from wrong directions."""
    values = brdf(HELD_OUT.wi, HELD_OUT.wo)[:, None] * np.ones(3)
    return angle_errors(values, shape_values(shape, HELD_OUT), HELD_OUT)


def lambert(wi, wo):
    return np.maximum(wi[:, 2], 0) / np.pi


def principled(**parameters):
    black = {"type": "rgb", "value": [0.0, 0.0, 0.0]}
    bsdf = mi.load_dict({"type": "principled", "base_color": black, "specular": 0.0, "roughness": 1.0, **parameters})
    return lambda wi, wo: reflected(bsdf, wi, wo).mean(axis=1)


def test_the_density_of_probe_directions_makes_integrals():
    """∫ cos θ/π dω = 1, and the energy of a mirror-like lobe without masking, at each view."""
    for view in HELD_OUT.views:
        assert (lambert(HELD_OUT.wi[view], None) / HELD_OUT.density[view]).sum() / 256 == pytest.approx(1, rel=0.01)
    head_on = HELD_OUT.views[0]
    narrow = microfacet.ggx(HELD_OUT.wi, HELD_OUT.wo, 0.02)[head_on] / HELD_OUT.density[head_on]
    assert narrow.sum() / 256 == pytest.approx(1, rel=0.01)


def test_the_dictionary_is_a_geometric_series():
    assert sigmas()[-1] == WIDEST
    assert sigmas()[1:] / sigmas()[:-1] == pytest.approx(np.full(len(sigmas()) - 1, RATIO), rel=1e-9)
    assert NARROWEST / RATIO < sigmas()[0] < NARROWEST * RATIO


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.3])
def test_a_beckmann_lobe_is_one_gaussian(alpha):
    """Slopes of variance α²/2 along either axis; two neighbouring widths of the finer dictionary at most."""
    shape = lobe_shapes.fitted(lambda wi, wo: microfacet.beckmann(wi, wo, alpha), alpha)
    bare = shape.bare
    assert len(bare) <= 2
    weight = bare.plain[:, 1] / bare.plain[:, 1].sum()
    assert np.sqrt(weight @ bare.sigmas**2) == pytest.approx(alpha / np.sqrt(2), rel=1e-3)
    assert bare.plain.sum(axis=0) == pytest.approx([1] * 3, rel=1e-3)
    assert not bare.grazing.any()
    assert not len(shape.coated)
    assert not shape.has_matte
    assert errors(shape, lambda wi, wo: microfacet.beckmann(wi, wo, alpha)).max() < 1e-3


@pytest.mark.parametrize(
    ("alpha", "even", "steep"), [(0.005, 0.105, 0.105), (0.02, 1e-3, 2e-3), (0.1, 0.007, 0.02), (0.3, 0.04, 0.09)]
)
def test_a_ggx_lobe_is_a_mixture(alpha, even, steep):
    """Half of each bound is misplaced light; the dictionary ends above the core of the narrowest."""
    error = errors(lobe_shapes.ggx(alpha), lambda wi, wo: microfacet.ggx(wi, wo, alpha))
    assert error[:STEEP].max() < even
    assert error[STEEP] < steep


@pytest.mark.parametrize("alpha", [0.02, 0.1])
def test_a_mixture_has_the_density_of_ggx(alpha):
    """α²/(π (α² + s²)²) over the slope s: from the core to ten times α."""
    bare = lobe_shapes.ggx(alpha).bare
    slope = np.geomspace(0.1 * alpha, 10 * alpha, 300)
    found = (np.exp(-0.5 * (slope[:, None] / bare.sigmas) ** 2) / (2 * np.pi * bare.sigmas**2)) @ bare.plain[:, 1]
    assert found == pytest.approx(alpha**2 / (np.pi * (alpha**2 + slope**2) ** 2), rel=0.12)


@pytest.mark.parametrize(("alpha", "even", "steep"), [(0.1, 0.007, 0.007), (0.3, 0.04, 0.07)])
def test_fresnel_is_told_from_the_shape(alpha, even, steep):
    shape = lobe_shapes.fresnel(alpha)
    error = errors(shape, lambda wi, wo: microfacet.dielectric(wi, wo, alpha))
    assert error[:STEEP].max() < even
    assert error[STEEP] < steep
    grazing, plain = shape.bare.grazing.sum(axis=0)[0], shape.bare.plain.sum(axis=0)[0]
    assert grazing / (plain + shape.coated.plain.sum(axis=0)[0]) == pytest.approx(24, rel=0.2)


def test_flakes_under_a_coat_are_told_from_bare_ones():
    shape = lobe_shapes.coated(0.3)
    assert errors(shape, lambda wi, wo: microfacet.coated_ggx(wi, wo, 0.3)).max() < 1e-3
    assert not len(shape.bare)


def test_the_clear_coat_of_the_principled_bsdf_is_fitted_as_it_is():
    """GTR1 with the masking of α = 0.25: a tail that no GGX has, of which a sum of Gaussians is some per cent off."""
    brdf = principled(clearcoat=1.0, clearcoat_gloss=0.8)
    error = errors(lobe_shapes.fitted(brdf, 0.05), brdf)
    assert error[:3].max() < 0.09
    assert error.max() < 0.14


def test_a_matte_lobe_is_its_cosine_lobes():
    shape = lobe_shapes.fitted(lambert, 0.0, with_matte=True, colour=(0.5, 0.2, 0.8))
    assert shape.matte[0] == pytest.approx([0.5, 0.2, 0.8], rel=1e-6)
    assert not shape.has_gaussians

    def under_coat(wi, wo):
        return lambert(wi, wo) * (1 - microfacet.schlick(wi[:, 2])) * (1 - microfacet.schlick(wo[:, 2]))

    shape = lobe_shapes.fitted(under_coat, 0.0, with_matte=True, colour=(0.5, 0.2, 0.8))
    assert shape.matte[1] == pytest.approx([0.5, 0.2, 0.8], rel=1e-6)


def test_a_lobe_that_is_matte_and_glossy_keeps_both():
    def both(wi, wo):
        return 0.3 * lambert(wi, wo) + 0.1 * microfacet.ggx(wi, wo, 0.3)

    shape = lobe_shapes.fitted(both, 0.0, with_matte=True)
    assert errors(shape, both).max() < 0.02
    assert shape.matte[0] == pytest.approx([0.3] * 3, rel=0.05)


def test_sheen_over_a_matte_base_is_fitted():
    brdf = principled(base_color={"type": "rgb", "value": [0.5, 0.5, 0.5]}, sheen=1.0)
    error = errors(lobe_shapes.fitted(brdf, 0.0, with_matte=True), brdf)
    assert error[:STEEP].max() < 0.07
    assert error[STEEP] < 0.12


def test_a_black_lobe_has_a_shape_without_weight():
    shape = lobe_shapes.fitted(lambda wi, wo: 0 * wi[:, 2], 0.1)
    assert len(shape.bare) == 1
    assert not shape.bare.plain.any()
    assert not shape_values(shape, HELD_OUT).any()
    assert not shape.is_mirror


def test_channels_are_fitted_each_by_itself():
    """A channel may be black; colours scale the weights and nothing else."""
    one = lobe_shapes.ggx(0.1)
    shape = lobe_shapes.fitted(lambda wi, wo: microfacet.ggx(wi, wo, 0.1), 0.1, colour=(1.0, 0.25, 0.0))
    assert not shape_values(shape, HELD_OUT)[:, 2].any()
    values, wanted = shape_values(shape, HELD_OUT), shape_values(one, HELD_OUT)
    assert angle_errors(values[:, :2], wanted[:, :2] * [1, 0.25], HELD_OUT).max() < 0.01


def test_errors_by_angle_forgive_a_scale_and_nothing_else():
    values = microfacet.ggx(HELD_OUT.wi, HELD_OUT.wo, 0.1)[:, None] * np.ones(3)
    assert angle_errors(values, 3 * values, HELD_OUT).max() < 1e-12
    wider = microfacet.ggx(HELD_OUT.wi, HELD_OUT.wo, 0.15)[:, None] * np.ones(3)
    assert angle_errors(values, wider, HELD_OUT).min() > 0.2
    assert angle_errors(values, 0 * values, HELD_OUT) == pytest.approx(np.ones(5))

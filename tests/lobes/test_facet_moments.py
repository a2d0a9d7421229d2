"""What is seen of the facets: against Mitsuba's own lobe, against brute force, and where it is plain to see."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.bsdf_eval import interaction
from rsibr.lobes.facet_moments import NODES, cosines, facet_moments
from rsibr.lobes.gaussians import Gaussians, LobeShape
from tests.arrays import to_numpy, vector
from tests.lobe_shapes import coated, ggx, one_gaussian
from tests.microfacet import by_quadrature, coated_ggx, facets, shadowing, viewer

AT = [6, 11, 16, 22, 27, NODES - 1]  # nodes: cosines from 0.035 to 1


def total_weight(shape):
    """Sum over the Gaussians of a lobe, at all nodes, in one channel."""
    return sum(moments.weight for moments in facet_moments(shape))[:, 0]


@pytest.mark.parametrize("sigma", [1e-3, 0.01, 0.03])
def test_head_on_facets_lean_nowhere_and_are_as_wide_as_they_are(sigma):
    (moments,) = facet_moments(one_gaussian(sigma))
    assert moments.lean[-1] == pytest.approx(0, abs=1e-9)
    assert moments.width[-1] == pytest.approx(sigma, rel=0.03)  # of a quadrature that cuts the tail off
    assert moments.weight[-1] == pytest.approx([1] * 3, rel=0.01)


def test_a_mirror_leans_nowhere_and_has_no_width():
    (moments,) = facet_moments(LobeShape.mirror())
    assert np.abs(moments.lean).max() < 1e-4
    assert moments.width.max() < 1e-4
    assert moments.weight == pytest.approx(np.ones((NODES, 3)), rel=2e-2)


@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.3])
def test_facets_lean_toward_the_viewer_the_more_the_flatter_the_view(sigma):
    (moments,) = facet_moments(one_gaussian(sigma))
    assert moments.lean.min() > -1e-6
    assert moments.lean[2] > 0.5 * sigma
    assert moments.lean[2] > moments.lean[16] > moments.lean[28] > moments.lean[-1]
    assert (moments.width <= 1.01 * sigma).all()


@pytest.mark.parametrize("sigma", [0.05, 0.2])
def test_energy_middle_and_width_are_those_of_brute_force(sigma):
    """A dense grid of slopes in float64: facets by their density, masking and h·v, without Fresnel."""
    (moments,) = facet_moments(one_gaussian(sigma))
    x, y = (5 * sigma * grid.ravel() for grid in np.meshgrid(*[np.linspace(-1, 1, 401)] * 2))
    h = np.stack([x, y, np.ones_like(x)], axis=1) / np.sqrt(1 + x**2 + y**2)[:, None]
    for node in AT:
        wo = viewer(cosines()[node])
        toward = h @ wo
        wi = 2 * toward[:, None] * h - wo
        seen = (toward > 0) & (wi[:, 2] > 0)
        share = np.exp(-0.5 * (x**2 + y**2) / sigma**2)[seen]
        share *= shadowing(wi[seen, 2], wo[2], sigma) / h[seen, 2]
        scale = np.arctan(np.hypot(x, y)) / np.maximum(np.hypot(x, y), 1e-12)
        along, across = (scale * x)[seen], (scale * y)[seen]
        lean = share @ along / share.sum()
        width = (share @ (along - lean) ** 2 * (share @ across**2)) ** 0.25 / np.sqrt(share.sum())
        energy = share @ toward[seen] / wo[2] / (2 * np.pi * sigma**2) * (10 * sigma / 400) ** 2
        assert moments.weight[node, 0] == pytest.approx(energy, rel=0.03)
        assert moments.lean[node] == pytest.approx(lean, abs=0.02 * sigma)
        assert moments.width[node] == pytest.approx(width, rel=0.03)


@pytest.mark.parametrize(("alpha", "steep"), [(0.05, 0.03), (0.2, 0.09)])
def test_weights_follow_the_albedo_of_a_metal(alpha, steep):
    """Brute force over GGX facets in float64, up to the one factor that all angles share; of the fit at the rim."""
    weight = total_weight(ggx(alpha))[AT]
    h = facets(alpha)
    albedo = []
    for cosine in cosines()[AT]:
        toward = h @ viewer(cosine)
        light = 2 * toward * h[:, 2] - cosine
        seen = (toward > 0) & (light > 0)
        masked = shadowing(light[seen], cosine, alpha)
        albedo.append((masked * toward[seen] / (cosine * h[seen, 2])).sum() / len(h))
    assert weight / weight[-1] == pytest.approx(np.array(albedo) / albedo[-1], rel=steep)
    assert weight[2:] / weight[-1] == pytest.approx(np.array(albedo)[2:] / albedo[-1], rel=0.03)


def test_weights_follow_the_albedo_of_mitsubas_conductor(rng):
    """Independent code; its masking is separable, ours correlated: a few per cent apart at grazing angles."""
    alpha, count = 0.1, 2**16
    bsdf = mi.load_dict({"type": "roughconductor", "material": "none", "alpha": alpha, "distribution": "ggx"})
    albedo = []
    for cosine in cosines()[AT[1:]]:
        draws = rng.random((3, count)).astype(np.float32)
        wo = vector(np.tile(viewer(cosine), (count, 1)))
        _, weight = bsdf.sample(mi.BSDFContext(), interaction(wo), mi.Float(draws[0]), mi.Point2f(draws[1:]))
        albedo.append(to_numpy(weight)[0].mean())
    weight = total_weight(ggx(alpha))[AT[1:]]
    assert weight / weight[-1] == pytest.approx(np.array(albedo) / albedo[-1], rel=0.05)


def test_weights_under_a_coat_follow_brute_force():
    """`proxy.coated_ggx` over all directions of the light, in float64 and written anew."""
    weight = total_weight(coated(0.3))[AT]
    v = np.array([viewer(min(cosine, 0.9999)) for cosine in cosines()[AT]])  # head-on has no plane of incidence
    n = np.tile([0.0, 0.0, 1.0], (len(v), 1))
    _, albedo = by_quadrature(np.ones_like, n, v, lambda wi, wo: coated_ggx(wi, wo, 0.3))
    assert weight / weight[-1] == pytest.approx(albedo / albedo[-1], rel=0.04)


def test_fresnel_weighs_grazing_facets():
    """(1 − cos)⁵ alone: next to nothing head-on, nearly all at grazing angles, and the exact value between."""
    plain = ggx(0.02)
    grazing = Gaussians(plain.bare.sigmas, 0 * plain.bare.plain, plain.bare.plain)
    graze = total_weight(LobeShape(plain.alpha, grazing, plain.coated, plain.matte)) / total_weight(plain)
    assert graze[-1] < 1e-4
    for node in (16, 22):
        assert graze[node] == pytest.approx((1 - cosines()[node]) ** 5, rel=0.03)
    assert graze[3] > 0.7

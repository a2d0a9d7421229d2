"""The model of one lobe against brute force in float64, and under lights whose reflection is known."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from tests.arrays import to_numpy, unit_vectors, vector
from tests.light.test_environment_pyramid import picture
from tests.microfacet import (
    IOR,
    by_quadrature,
    coated_ggx,
    ggx,
    into_coat,
    metal,
    pairs,
    schlick,
    soft_sky,
    unit,
    viewer,
)

PLAIN = np.ones((1, 3))
COATED = np.array([[0.0] * 3, [0.0] * 3, [1.0] * 3])
KERNELS = {
    "mirror": LobeShape.mirror(),
    "metal": LobeShape.of(ProxyLobe((0.1,), (PLAIN,))),
    "smooth metal": LobeShape.of(ProxyLobe((0.01,), (PLAIN,))),
    "Fresnel's metal": LobeShape.of(ProxyLobe((0.05, 0.2), (np.array([[0.04] * 3, [0.96] * 3]), 0.3 * COATED))),
    "coated": LobeShape.of(ProxyLobe((0.3,), (COATED,))),
    "matte": LobeShape.of(ProxyLobe((LAMBERT,), (np.array([[0.5, 0.2, 0.0], [0.1, 0.0, 0.3]]),))),
}


@pytest.fixture(scope="module")
def light():
    image = picture(soft_sky, 256)
    return EnvironmentPyramid.of(image), Light(image)


@pytest.fixture(scope="module")
def even():
    image = np.full((64, 64, 3), 2.5, np.float32)
    return EnvironmentPyramid.of(image), Light(image)


def at_points(kernel, light, n, v):
    return to_numpy(LobeIntegral.of(kernel, *light).radiance(vector(n), vector(v))).T


def in_map(kernel, light, n, frame, spacing):
    """As a map is made, at normals (K, 3) in the map's frame."""
    model, matrix = LobeIntegral.of(kernel, *light), mi.Matrix3f(frame.astype(np.float32))
    grid = model.grid(matrix) if model.has_grid else None
    return to_numpy(model.radiance_in_map(vector(n), matrix, grid, mi.Float(spacing))).T


def disk_normals(rng, count, rim=0.999):
    r, turn = rim * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    return np.stack([r * np.cos(turn), r * np.sin(turn), np.sqrt(1 - r * r)], axis=1)


@pytest.mark.parametrize("name", KERNELS)
def test_an_even_light_is_reflected_evenly(name, even, rng):
    """The white furnace: over its albedo every lobe gives back the light, head-on and at the rim, in maps and alone."""
    n, v = unit_vectors(rng, 500), unit_vectors(rng, 500)
    v *= np.where((n * v).sum(1, keepdims=True) < 0, -1, 1)
    v[0] = n[0]
    assert np.abs(at_points(KERNELS[name], even, n, v) / 2.5 - 1).max() < 2e-6
    frame = view_frame([1, 2, 3])
    local = np.concatenate([disk_normals(rng, 500, 1.0), [[0, 0, 1], [1, 0, 0], [0.6, -0.8, 0]]])
    assert np.abs(in_map(KERNELS[name], even, local, frame, 2 / 64) / 2.5 - 1).max() < 2e-6


def test_a_mirror_shows_the_light_where_it_is(light, rng):
    n, v = pairs(rng, 300)
    mirrored = soft_sky(2 * (n * v).sum(1, keepdims=True) * n - v)
    assert np.abs(at_points(KERNELS["mirror"], light, n, v) / mirrored - 1).max() < 0.02


def error(found, exact):
    """Mean of the relative error, and its largest."""
    relative = np.abs(found / exact - 1)
    return relative.mean(), relative.max()


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.3])
def test_a_metal_is_that_of_brute_force(alpha, light, rng):
    n, v = pairs(rng, 60)
    radiance, albedo = metal(soft_sky, n, v, alpha)
    kernel = LobeShape.of(ProxyLobe((alpha,), (PLAIN,)))
    mean, largest = error(at_points(kernel, light, n, v), radiance / albedo[:, None])
    assert mean < 0.01
    assert largest < 0.06


def test_fresnel_is_weighed_facet_by_facet(light, rng):
    """A dielectric's lobe: grazing facets count more, and they look elsewhere."""
    n, v = pairs(rng, 40)
    radiance, albedo = metal(soft_sky, n, v, 0.1, lambda toward: 0.04 + 0.96 * schlick(toward))
    kernel = LobeShape.of(ProxyLobe((0.1,), (np.array([[0.04] * 3, [0.96] * 3]),)))
    mean, largest = error(at_points(kernel, light, n, v), radiance / albedo[:, None])
    assert mean < 0.015
    assert largest < 0.08


@pytest.fixture(scope="module")
def flakes():
    """Normals, views, and what flakes under a coat show there, over their albedo."""
    n, v = pairs(np.random.default_rng(8), 24)
    radiance, albedo = by_quadrature(soft_sky, n, v, lambda wi, wo: coated_ggx(wi, wo, 0.3), rows=200, columns=400)
    return n, v, radiance / albedo[:, None]


def test_flakes_under_a_coat_are_those_of_brute_force(light, flakes):
    n, v, exact = flakes
    mean, largest = error(at_points(KERNELS["coated"], light, n, v), exact)
    assert mean < 0.015
    assert largest < 0.06


@pytest.mark.parametrize("under_coat", [False, True])
def test_a_facet_spans_the_solid_angle_of_the_directions_that_it_reflects(even, under_coat):
    """dω_i/dω_h by finite differences, in float64: the facet turned a little both ways, the two reflections crossed."""
    v = viewer(0.8)
    facets = unit(np.array([[0.05, 0.0, 1.0], [0.2, 0.1, 1.0], [-0.1, 0.2, 1.0], [0.3, -0.1, 1.0]]))

    def reflected(h):
        inner = into_coat(v) if under_coat else v
        w = 2 * (h @ inner)[:, None] * h - inner
        lateral = w[:, :2] * (IOR if under_coat else 1)
        return np.concatenate([lateral, np.sqrt(1 - (lateral**2).sum(axis=1, keepdims=True))], axis=1)

    tangents = unit(np.cross(facets, [0.0, 1.0, 0.0]))
    turns = [reflected(unit(facets + 1e-5 * t)) for t in (tangents, np.cross(facets, tangents))]
    spanned = np.linalg.norm(np.cross(*[turn - reflected(facets) for turn in turns]), axis=1) / 1e-10

    integral = LobeIntegral.of(KERNELS["coated" if under_coat else "metal"], *even)
    count = len(facets)
    shading = ShadingFrame.of(vector(np.tile([0.0, 0.0, 1.0], (count, 1))), vector(np.tile(v, (count, 1))))
    w, *_, stretch = (integral._coated if under_coat else integral._bare)(shading, vector(facets))
    local = reflected(facets)
    assert pytest.approx(local, abs=1e-5) == to_numpy(w).T
    assert np.array(stretch) == pytest.approx(spanned, rel=1e-3)


def test_a_coat_makes_a_difference(light, flakes):
    """Negative control: without it the same flakes are far off."""
    n, v, exact = flakes
    bare = LobeShape.of(ProxyLobe((0.3,), (PLAIN,)))
    assert error(at_points(bare, light, n, v), exact)[0] > 0.05


def test_flakes_with_and_without_a_coat_are_mixed_as_they_are_seen(light):
    """At grazing angles the coat keeps its flakes' light to itself: the bare ones count for more."""
    n, v = pairs(np.random.default_rng(9), 24, least=0.08)

    def mixed(wi, wo):
        return 0.2 * ggx(wi, wo, 0.12) + coated_ggx(wi, wo, 0.5)

    radiance, albedo = by_quadrature(soft_sky, n, v, mixed, rows=300, columns=600)
    plain, coated = np.array([[0.2] * 3]), np.array([[0.0] * 3, [0.0] * 3, [1.0] * 3])
    kernel = LobeShape.of(ProxyLobe((0.12, 0.5), (plain, coated)))
    mean, largest = error(at_points(kernel, light, n, v), radiance / albedo[:, None])
    assert mean < 0.021
    assert largest < 0.12


@pytest.mark.parametrize("name", ["metal", "Fresnel's metal", "coated"])
def test_a_map_is_made_of_the_same_light_as_its_points(name, light, rng):
    """The coarse grid of the wide part costs next to nothing inside; a texel of no size is a point."""
    frame = view_frame([0.3, -0.5, 0.8])
    local = disk_normals(rng, 400, 0.98)
    n, v = local @ frame.T, np.tile(frame[:, 2], (400, 1))
    mean, largest = error(in_map(KERNELS[name], light, local, frame, 0.0), at_points(KERNELS[name], light, n, v))
    assert mean < 0.004
    assert largest < 0.05


def test_a_matte_lobe_shows_the_irradiance_whatever_the_view(light, rng):
    n, v = pairs(rng, 50)
    model = LobeIntegral.of(KERNELS["matte"], *light)
    first = to_numpy(model.radiance(vector(n), vector(v)))
    assert np.array_equal(first, to_numpy(model.radiance(vector(n), vector(n))))
    assert not model.has_grid

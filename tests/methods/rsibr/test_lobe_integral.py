"""The model of one lobe against brute force in float64, and under lights whose reflection is known."""

from functools import cache

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.rsibr import view_nodes
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from tests.arrays import to_numpy, unit_vectors, vector
from tests.lobe_shapes import coated, fitted, fresnel, ggx, matte
from tests.microfacet import by_quadrature, coated_ggx, metal, pairs, schlick, soft_sky
from tests.microfacet import ggx as exact_ggx

ONE = np.ones((len(node_cosines()), 3))
KERNELS = {
    "mirror": LobeShape.mirror,
    "metal": lambda: ggx(0.1),
    "smooth metal": lambda: ggx(0.01),
    "rough metal": lambda: ggx(0.5),
    "dielectric": lambda: fresnel(0.1),
    "coated": lambda: coated(0.3),
    "matte": matte,
}


@pytest.fixture(scope="module")
def even():
    image = np.full((64, 64, 3), 2.5, np.float32)
    return EnvironmentPyramid.of(image), Light(image)


@cache
def integral(shape, light):
    """Of one lobe with an albedo of 1; kept, since its view nodes take seconds."""
    return LobeIntegral.of([(shape, ONE)], *light)


def at_points(shape, light, n, v):
    return to_numpy(integral(shape, light).radiance(vector(n), vector(v))).T


def in_map(shape, light, n, frame, spacing):
    """As a map is made, at normals (K, 3) in the map's frame."""
    model, matrix = integral(shape, light), mi.Matrix3f(frame.astype(np.float32))
    return to_numpy(model.radiance_in_map(vector(n), matrix, model.grid(matrix), mi.Float(spacing))).T


def disk_normals(rng, count, rim=0.999):
    r, turn = rim * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    return np.stack([r * np.cos(turn), r * np.sin(turn), np.sqrt(1 - r * r)], axis=1)


@pytest.mark.parametrize("name", ["mirror", "metal", "coated", "matte"])
def test_an_even_light_is_reflected_evenly(name, even, rng, monkeypatch):
    """The white furnace: over its albedo every lobe gives back the light, head-on and at the rim.

    Narrow and wide parts divide the albedo alike but where the frame of a narrow one is clamped, below 1e-3.
    """
    monkeypatch.setattr(view_nodes, "SUBDIVISION", 1)  # of 42 views: what is even is so at all
    n, v = unit_vectors(rng, 500), unit_vectors(rng, 500)
    v *= np.where((n * v).sum(1, keepdims=True) < 0, -1, 1)
    v[0] = n[0]
    error = np.abs(at_points(KERNELS[name](), even, n, v) / 2.5 - 1)
    assert error[(n * v).sum(axis=1) > 1e-3].max() < 2e-6
    assert error.max() < 2e-4


@pytest.mark.parametrize("name", KERNELS)
def test_an_even_light_is_reflected_evenly_in_maps(name, even, rng):
    frame = view_frame([1, 2, 3])
    local = np.concatenate([disk_normals(rng, 500, 1.0), [[0, 0, 1], [1, 0, 0], [0.6, -0.8, 0]]])
    error = np.abs(in_map(KERNELS[name](), even, local, frame, 2 / 64) / 2.5 - 1)
    assert error[local[:, 2] > 1e-3].max() < 2e-6
    assert error.max() < 2e-4


def test_a_mirror_shows_the_light_where_it_is(light, rng):
    n, v = pairs(rng, 300)
    mirrored = soft_sky(2 * (n * v).sum(1, keepdims=True) * n - v)
    assert np.abs(at_points(LobeShape.mirror(), light, n, v) / mirrored - 1).max() < 0.02


def error(found, exact):
    """Mean of the relative error, and its largest."""
    relative = np.abs(found / exact - 1)
    return relative.mean(), relative.max()


@pytest.mark.parametrize(
    ("alpha", "mean_bound", "bound"),
    [pytest.param(0.02, 0.001, 0.006, marks=pytest.mark.slow), (0.1, 0.004, 0.03), (0.3, 0.013, 0.065)],
)
def test_a_metal_is_that_of_brute_force(alpha, mean_bound, bound, light, rng):
    n, v = pairs(rng, 60)
    radiance, albedo = metal(soft_sky, n, v, alpha)
    mean, largest = error(at_points(ggx(alpha), light, n, v), radiance / albedo[:, None])
    assert mean < mean_bound
    assert largest < bound


@pytest.mark.slow
def test_fresnel_is_weighed_facet_by_facet(light, rng):
    """A dielectric's lobe: grazing facets count more, and they look elsewhere."""
    n, v = pairs(rng, 40)
    radiance, albedo = metal(soft_sky, n, v, 0.1, lambda toward: 0.04 + 0.96 * schlick(toward))
    mean, largest = error(at_points(fresnel(0.1), light, n, v), radiance / albedo[:, None])
    assert mean < 0.004
    assert largest < 0.035


@pytest.fixture(scope="module")
def flakes():
    """Normals, views, and what flakes under a coat show there, over their albedo."""
    n, v = pairs(np.random.default_rng(8), 24)
    radiance, albedo = by_quadrature(soft_sky, n, v, lambda wi, wo: coated_ggx(wi, wo, 0.3), rows=200, columns=400)
    return n, v, radiance / albedo[:, None]


def test_flakes_under_a_coat_are_those_of_brute_force(light, flakes):
    n, v, exact = flakes
    mean, largest = error(at_points(coated(0.3), light, n, v), exact)
    assert mean < 0.015
    assert largest < 0.06


def test_a_coat_makes_a_difference(light, flakes):
    """Negative control: without it the same flakes are far off."""
    n, v, exact = flakes
    assert error(at_points(ggx(0.3), light, n, v), exact)[0] > 0.05


@pytest.mark.slow
def test_flakes_with_and_without_a_coat_are_mixed_as_they_are_seen(light):
    """At grazing angles the coat keeps its flakes' light to itself: the bare ones count for more."""
    n, v = pairs(np.random.default_rng(9), 24, least=0.08)

    def mixed(wi, wo):
        return 0.2 * exact_ggx(wi, wo, 0.12) + coated_ggx(wi, wo, 0.5)

    radiance, albedo = by_quadrature(soft_sky, n, v, mixed, rows=300, columns=600)
    mean, largest = error(at_points(fitted(mixed, 0.3), light, n, v), radiance / albedo[:, None])
    assert mean < 0.018
    assert largest < 0.07


@pytest.mark.parametrize("name", ["metal", pytest.param("dielectric", marks=pytest.mark.slow), "coated"])
def test_a_map_is_made_of_the_same_light_as_its_points(name, light, rng):
    """The coarse grid of the wide part costs next to nothing inside; a texel of no size is a point."""
    frame = view_frame([0.3, -0.5, 0.8])
    local = disk_normals(rng, 400, 0.98)
    n, v = local @ frame.T, np.tile(frame[:, 2], (400, 1))
    mean, largest = error(in_map(KERNELS[name](), light, local, frame, 0.0), at_points(KERNELS[name](), light, n, v))
    assert mean < 0.002
    assert largest < 0.02


def test_a_matte_lobe_shows_the_irradiance_whatever_the_view(light, rng):
    n, v = pairs(rng, 50)
    model = integral(matte(), light)
    first = to_numpy(model.radiance(vector(n), vector(v)))
    assert np.array_equal(first, to_numpy(model.radiance(vector(n), vector(n))))
    assert model.wide is None
    assert model.narrow is None

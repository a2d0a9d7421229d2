"""The model of whole maps: all of the albedo under an even light, and brute force under a sky."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.rsibr.half_vector_lobes import HalfVectorLobes
from tests.arrays import to_numpy, vector
from tests.light.test_environment_pyramid import picture
from tests.methods.rsibr.test_lobe_integral import COATED, PLAIN, disk_normals
from tests.microfacet import by_quadrature, coated_ggx, metal, soft_sky, viewer

N = 96
FRAME = view_frame([0.3, -0.5, 0.8])
ONE = np.ones((len(node_cosines()), 3))
KERNELS = {
    "mirror": LobeShape.mirror(),
    "narrow": LobeShape.of(ProxyLobe((0.01,), (PLAIN,))),
    "metal": LobeShape.of(ProxyLobe((0.1,), (PLAIN,))),
    "coated": LobeShape.of(ProxyLobe((0.3,), (COATED,))),
    "matte": LobeShape.of(ProxyLobe((LAMBERT,), (np.array([[0.5, 0.2, 0.0], [0.1, 0.0, 0.3]]),))),
}


@pytest.fixture(scope="module")
def light():
    image = picture(soft_sky, 256)
    return EnvironmentPyramid.of(image), Light(image)


def radiance(lobes, light, n, resolution=N):
    """Of lobes (kernel, albedo table) at normals (K, 3) in the map's frame."""
    made, frame = HalfVectorLobes.of(lobes, *light, resolution), mi.Matrix3f(FRAME.astype(np.float32))
    return to_numpy(made.radiance(vector(n), frame, made.gathered(frame), mi.Float(2 / resolution))).T


def of_even_light(names, n):
    """Reflected light over that of an even sky times the albedo, at normals of a map."""
    image = np.full((64, 64, 3), 2.5, np.float32)
    shares = np.array([[0.7, 0.4, 0.1], [0.04, 0.05, 0.06], [0.3, 0.2, 0.5]])[: len(names)]
    lobes = [(KERNELS[name], share * ONE) for name, share in zip(names, shares, strict=True)]
    return radiance(lobes, (EnvironmentPyramid.of(image), Light(image)), n) / (2.5 * shares.sum(axis=0))


@pytest.mark.parametrize("names", [["mirror"], ["metal"], ["coated"], ["matte"], ["matte", "mirror", "coated"]])
def test_an_even_light_is_reflected_as_the_albedo_says(names, rng):
    """At every angle up to the rim: no light is lost between levels, matte lobes and a metal's sharp part."""
    n = np.concatenate([disk_normals(rng, 1000, 1.0), [[0, 0, 1], [1, 0, 0], [0.6, -0.8, 0]]])
    assert np.abs(of_even_light(names, n) - 1).max() < 2e-4


@pytest.mark.parametrize("names", [["narrow"], ["matte", "narrow", "coated"]])
def test_what_passes_from_the_pyramid_to_the_sharp_part_is_not_lost(names, rng):
    """Its share is known at the texels of the one and exactly in the other: they differ where it changes fast."""
    assert np.abs(of_even_light(names, disk_normals(rng, 1000, 0.99)) - 1).max() < 1e-3
    assert np.abs(of_even_light(names, disk_normals(rng, 1000, 1.0)) - 1).max() < 0.08


def test_an_albedo_of_the_angle_is_followed(rng):
    """Steep as Fresnel's: to what the facet map's own texels can follow of it at the rim."""
    image = np.ones((64, 64, 3), np.float32)
    table = (0.05 + 0.95 * (1 - node_cosines()) ** 5)[:, None] * ONE
    n = disk_normals(rng, 2000, 0.995)
    found = radiance([(KERNELS["metal"], table)], (EnvironmentPyramid.of(image), Light(image)), n)[:, 0]
    exact = 0.05 + 0.95 * (1 - n[:, 2]) ** 5
    assert np.abs(found / exact - 1).max() < 0.02
    assert np.abs(found / exact - 1).mean() < 4e-3


def against(kernel, brute_force, light, rng, rim=0.9):
    """Relative errors at normals of a map, with the exact albedo."""
    local = disk_normals(rng, 60, rim)
    n, v = local @ FRAME.T, np.tile(FRAME[:, 2], (60, 1))
    exact, _ = brute_force(soft_sky, n, v)
    cosine = np.clip(node_cosines(), 2e-3, 0.9999)
    views = np.array([viewer(c) for c in cosine])
    _, albedo = brute_force(np.ones_like, np.tile([0.0, 0.0, 1.0], (len(views), 1)), views)
    found = radiance([(kernel, albedo[:, None] * ONE)], light, local)
    return np.abs(found / exact - 1)


@pytest.mark.parametrize("alpha", [0.03, 0.1, 0.3])
def test_a_metal_is_nearly_that_of_brute_force(alpha, light, rng):
    kernel = LobeShape.of(ProxyLobe((alpha,), (PLAIN,)))
    error = against(kernel, lambda sky, n, v: metal(sky, n, v, alpha), light, rng)
    assert error.mean() < 0.03
    assert error.max() < 0.25


def test_flakes_under_a_coat_are_nearly_those_of_brute_force(light, rng):
    def brute_force(sky, n, v):
        return by_quadrature(sky, n, v, lambda wi, wo: coated_ggx(wi, wo, 0.3), rows=150, columns=300)

    error = against(KERNELS["coated"], brute_force, light, rng)
    assert error.mean() < 0.04
    assert error.max() < 0.25


def mirrored(local):
    """The sky that a mirror shows at normals (K, 3) in the map's frame."""
    n = local @ FRAME.T
    return soft_sky(2 * (n @ FRAME[:, 2])[:, None] * n - FRAME[:, 2])


@pytest.mark.parametrize("limit", [0.9, 1.0])
def test_a_mirror_shows_the_mean_over_each_texel(light, rng, limit):
    """Against 32² points of the texel that a normal lies in, those outside the disk left out."""
    local, resolution, count = disk_normals(rng, 100, limit), 24, 32
    corner = np.floor((local[:, :2] + 1) * resolution / 2) * 2 / resolution - 1
    places = np.stack(np.meshgrid(*[(np.arange(count) + 0.5) / count * 2 / resolution] * 2), axis=-1).reshape(-1, 2)
    p = corner[:, None] + places
    inside = (p**2).sum(axis=-1) < 1
    z = np.sqrt(np.maximum(1 - (p**2).sum(axis=-1, keepdims=True), 0))
    seen = mirrored(np.concatenate([p, z], axis=-1).reshape(-1, 3)).reshape(len(local), -1, 3)
    expected = (seen * inside[..., None]).sum(axis=1) / inside.sum(axis=1)[:, None]
    error = np.abs(radiance([(KERNELS["mirror"], ONE)], light, local, resolution) / expected - 1)
    at_points = np.abs(mirrored(local) / expected - 1)
    assert error.mean() < 0.01
    assert error.mean() < 0.2 * at_points.mean()


def test_parts_add_up_to_the_whole(light, rng):
    """A lobe taken alone is its share of all of them, to rounding."""
    lobes = [(KERNELS["matte"], 0.3 * ONE), (KERNELS["narrow"], 0.1 * ONE), (KERNELS["coated"], 0.5 * ONE)]
    n, frame = disk_normals(rng, 500, 1.0), mi.Matrix3f(FRAME.astype(np.float32))
    found = []
    for part in (None, *(kernel for kernel, _ in lobes)):
        made = HalfVectorLobes.of(lobes, *light, N, part)
        found.append(to_numpy(made.radiance(vector(n), frame, made.gathered(frame), mi.Float(2 / N))))
    assert np.abs(sum(found[1:]) - found[0]).max() < 1e-5 * found[0].max()
    assert min(part.max() for part in found[1:]) > 0.05 * found[0].max()

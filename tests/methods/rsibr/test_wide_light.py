"""Light of wide Gaussians at the nodes of the polar grid: brute force over the same lobe, up to grazing angles."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.lobes.albedo import node_cosines
from rsibr.methods.lobe_terms import LobeTerms
from rsibr.methods.rsibr.half_vector_pyramid import HalfVectorPyramid
from rsibr.methods.rsibr.half_vector_quadrature import HalfVectorQuadrature
from rsibr.methods.rsibr.polar_grid import RINGS, SECTORS, PolarGrid
from rsibr.methods.rsibr.wide_light import WideLight
from tests.arrays import to_numpy
from tests.light.test_environment_pyramid import picture
from tests.lobe_shapes import ggx, one_gaussian
from tests.microfacet import beckmann, by_quadrature, soft_sky, under_coat

FRAME = view_frame([0.3, -0.5, 0.8])
ONE = np.ones((len(node_cosines()), 3))
AT = np.array([0, 8, 16, 21, 23])
"""Rings: 0°, 30°, 60°, 79° and 86° for 24 rings."""

G, POINTS = 96, 224


@pytest.fixture(scope="module")
def light():
    return EnvironmentPyramid.of(picture(soft_sky, 256))


def terms(shape):
    return LobeTerms.of([(shape, ONE)]).gaussians


def gathered(shape, light, resolution=G, points=POINTS):
    """Mean light at all nodes, (RINGS + 1, SECTORS, 3)."""
    wide = WideLight.of(terms(shape), terms(shape), resolution, points)
    grid = wide.grid(HalfVectorPyramid.of(mi.Matrix3f(FRAME.astype(np.float32)), light, resolution))
    return grid.nodes.numpy().reshape(RINGS + 1, SECTORS, 4)[..., :3]


def exact(brdf, nodes, sky=soft_sky, rows=200):
    """Mean light over a kernel at nodes of the rings `AT`, each at one azimuth."""
    normals = to_numpy(PolarGrid.normals()).T.reshape(RINGS + 1, SECTORS, 3)[AT, nodes]
    polar = np.arccos(np.clip(normals[:, 2], 0, 1))
    normals[0] = [1e-3, 0, 1]  # head-on has no plane of incidence
    assert polar == pytest.approx(AT * np.pi / 2 / RINGS, abs=1e-3)
    n = normals / np.linalg.norm(normals, axis=1, keepdims=True) @ FRAME.T
    radiance, energy = by_quadrature(sky, n, np.tile(FRAME[:, 2], (len(n), 1)), brdf, rows=rows, columns=2 * rows)
    return radiance / energy[:, None]


@pytest.mark.parametrize(
    ("sigma", "is_coated", "bound"),
    [
        (0.16, False, 0.0015),
        (0.3, False, 0.0025),
        (0.6, False, 0.008),
        (0.16, True, 0.0025),
        (0.3, True, 0.015),
        (0.6, True, 0.008),
    ],
)
def test_mean_light_is_that_of_brute_force(sigma, is_coated, bound, light):
    """One Gaussian with the masking of α = 0.25; at 86° only some of its facets are seen."""

    def bare(wi, wo):
        return beckmann(wi, wo, sigma * np.sqrt(2), 0.25)

    sectors = (AT * 7) % SECTORS
    found = gathered(one_gaussian(sigma, 0.25, under_coat=is_coated), light)[AT, sectors]
    error = np.abs(found / exact((lambda wi, wo: under_coat(bare, wi, wo)) if is_coated else bare, sectors) - 1)
    assert error.max() < bound
    assert error.mean() < bound / 2


@pytest.mark.parametrize(("sigma", "alpha", "bound"), [(0.12, 0.2, 0.06), (0.28, 0.4, 0.06), (0.6, 0.6, 0.25)])
@pytest.mark.parametrize("lamp", [[0.8, 0.1, -0.6], [0.3, -0.9, 0.3], [-0.5, 0.4, 0.8]], ids=["side", "below", "front"])
def test_a_small_lamp_is_seen_with_its_energy_at_every_angle(sigma, alpha, bound, lamp):
    """A lamp 2.3° wide over a dim sky: between the points of the quadrature, or behind the horizon of its kernel."""
    toward = np.array(lamp) / np.linalg.norm(lamp)

    def sky(d):
        return 0.02 + 60 * np.exp(-0.5 * (1 - d @ toward) / 4e-4)[..., None] * np.array([1, 0.8, 0.6])

    sectors = (AT * 7) % SECTORS
    found = gathered(one_gaussian(sigma, alpha), EnvironmentPyramid.of(picture(sky, 512)))[AT, sectors]
    wanted = exact(lambda wi, wo: beckmann(wi, wo, sigma * np.sqrt(2), alpha), sectors, sky, rows=800)
    error = (np.abs(found / wanted - 1))[wanted[:, 0] > 0.1 * wanted[:, 0].max()]  # where the lamp is seen at all
    assert error.max() < bound
    assert np.median(error) < 0.02


def test_more_points_come_nearer(light):
    sectors = (AT * 7) % SECTORS
    wanted = exact(lambda wi, wo: beckmann(wi, wo, 0.3 * np.sqrt(2), 0.25), sectors)
    errors = [
        np.abs(gathered(one_gaussian(0.3, 0.25), light, *how)[AT, sectors] / wanted - 1).mean()
        for how in ((96, 40), (96, 224))
    ]
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("shape", [lambda: ggx(0.3), lambda: one_gaussian(0.3, under_coat=True)], ids=["ggx", "coated"])
def test_weights_of_a_ring_add_up_to_one(shape):
    wide = [term for term in terms(shape()) if term.is_wide]
    made = HalfVectorQuadrature.of(wide, wide, G, POINTS)
    assert made.weights.sum(axis=1) == pytest.approx(np.ones((RINGS + 1, 3)), rel=1e-12)
    assert (made.weights >= 0).all()
    assert np.hypot(*np.moveaxis(made.places, -1, 0)).max() <= 1


def test_points_of_a_part_are_those_of_the_whole():
    lobes = [(ggx(0.3), ONE), (one_gaussian(0.3, under_coat=True), 0.2 * ONE)]
    wholes = [term for term in LobeTerms.of(lobes).gaussians if term.is_wide]
    made = HalfVectorQuadrature.of(wholes, wholes, G, POINTS)
    for shape, _ in lobes:
        parts = [term for term in LobeTerms.of(lobes, shape).gaussians if term.is_wide]
        part = HalfVectorQuadrature.of(wholes, parts, G, POINTS)
        rows = {tuple(row) for row in made.places[8]}
        assert {tuple(row) for row in part.places[8]} <= rows
    nothing = [term for term in LobeTerms.of(lobes, one_gaussian(0.2)).gaussians if term.is_wide]
    assert HalfVectorQuadrature.of(wholes, nothing, G, POINTS) is None


def test_there_is_nothing_to_gather_without_wide_gaussians():
    assert WideLight.of(terms(one_gaussian(0.09)), terms(one_gaussian(0.09))) is None

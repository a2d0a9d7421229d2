"""Prefiltered cubes against brute force in float64, harmonic bands, and a sun of one texel."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.cube import CUBE
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from rsibr.methods.split_sum.prefiltered_cube import (
    PrefilteredCube,
    Sources,
    cube_size,
    level_of_roughness,
    mip_chain,
    prefiltered,
    roughness_of_level,
)
from tests.arrays import unit_vectors
from tests.methods.split_sum.lights import band_factors, brute, lamps, light_of, sun, unit_texels


def centres(size):
    d = np.array(texel_directions(CUBE, size), dtype=np.float64).T
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def relative(got, wanted):
    return np.sqrt(((got - wanted) ** 2).mean() / (wanted**2).mean())


@pytest.mark.parametrize(("alpha", "size"), [(1.0, 32), (0.3, 64), (0.09, 64), (0.03, 96)])
def test_it_is_the_sum_over_all_light(alpha, size, rng):
    sources = Sources.of(light_of(lamps)).points
    found = prefiltered(sources, alpha, size).reshape(-1, 3)
    chosen = rng.choice(len(found), 150, replace=False)
    wanted = brute(sources, alpha, centres(size)[chosen])
    assert relative(found[chosen], wanted) < 0.005
    assert np.median(np.abs(found[chosen] / wanted - 1)) < 0.003  # faint places too, not the bright ones alone


def test_it_keeps_the_energy():
    sources = Sources.of(light_of(lamps)).points
    total = sources.weights[:, :3].sum(axis=0)
    for alpha in (0.3, 0.05):
        found = prefiltered(sources, alpha, 64)
        kept = np.einsum("fhw,fhwc->c", texel_solid_angles(CUBE, 64), found)
        np.testing.assert_allclose(kept, total, rtol=0.002)


@pytest.mark.parametrize("alpha", [0.04, 1.0])
def test_constant_light_stays_what_it_is(alpha):
    sources = Sources.of(light_of(lambda _: np.array([[0.5, 1.0, 2.0]]))).points
    found = prefiltered(sources, alpha, 48)
    np.testing.assert_allclose(found, np.broadcast_to([0.5, 1, 2], found.shape), rtol=2e-3)


@pytest.mark.parametrize("alpha", [0.05, 0.5])
def test_each_band_of_harmonics_is_scaled_by_its_factor(alpha):
    """Legendre polynomials of d·a, shifted to be positive: the factor is a quadrature over the kernel alone."""
    factors, axis = band_factors(alpha, 13), np.array([0.48, 0.6, -0.64])
    bands = (1, 4, 12)
    legendre = [np.polynomial.legendre.Legendre.basis(band) for band in bands]
    sources = Sources.of(light_of(lambda d: np.stack([2 + p(d @ axis) for p in legendre], axis=1))).points
    found = prefiltered(sources, alpha, 32).reshape(-1, 3)
    wanted = np.stack([2 + factors[b] * p(centres(32) @ axis) for b, p in zip(bands, legendre, strict=True)], axis=1)
    np.testing.assert_allclose(found, wanted, atol=5e-3)


@pytest.mark.parametrize("alpha", [0.02, 0.09, 0.4])
def test_a_sun_of_one_texel_rings_nowhere(alpha):
    sources = Sources.of(light_of(sun)).points
    size = cube_size(alpha)
    found = prefiltered(sources, alpha, size).reshape(-1, 3)
    assert found.min() > 0.0097
    d, places = unit_texels(), centres(size)
    place = d[np.argmax(sources.weights[:, 0])]
    near = np.argsort(-places @ place)
    chosen = np.concatenate([near[:40], near[:: len(near) // 100]])
    wanted = brute(sources, alpha, places[chosen])
    np.testing.assert_allclose(found[chosen], wanted, rtol=0.03, atol=3e-4 * wanted.max())  # at the horizon's kink
    away = places[chosen] @ place < -0.15
    np.testing.assert_allclose(found[chosen][away], 0.01, rtol=0.02)  # the sky, next to 1e8 times the radiance


def test_levels_of_a_chain_are_at_filaments_roughnesses():
    assert roughness_of_level(0, 5) == 0
    assert roughness_of_level(4, 5) == 1
    np.testing.assert_allclose(np.sqrt(roughness_of_level(2, 5)), 1 - np.sqrt(0.5))
    for alpha in (0.01, 0.2, 0.9):
        place = level_of_roughness(alpha, 6)
        p = np.sqrt(alpha)
        np.testing.assert_allclose(place, 5 * p * (2 - p))
    np.testing.assert_allclose(level_of_roughness(roughness_of_level(3, 5), 5), 3)


def test_a_chain_is_exact_at_its_levels_and_between_them_near(rng):
    sources = Sources.of(light_of(lambda d: 1 + 0.5 * d))
    chain = mip_chain(sources, 64)
    assert len(chain) == 3
    d = unit_vectors(rng, 200)
    there = mi.Vector3f(d.T.astype(np.float32))
    for alpha in (0.0, roughness_of_level(1, 3), 0.3, 1.0):
        factor = band_factors(max(min(alpha, 1 - 1e-9), 1e-6), 2)[1] if alpha else 1.0
        found = np.array(PrefilteredCube.in_chain(chain, alpha).lookup(there)).T
        np.testing.assert_allclose(found, 1 + 0.5 * factor * d, atol=0.06 if alpha == 0.3 else 0.012)


def test_without_roughness_it_is_the_environment(rng):
    sources = Sources.of(light_of(lambda d: 1 + 0.5 * d))
    d = unit_vectors(rng, 200)
    found = np.array(PrefilteredCube.exact(sources, 0.0, 64).lookup(mi.Vector3f(d.T.astype(np.float32)))).T
    np.testing.assert_allclose(found, 1 + 0.5 * d, atol=0.01)

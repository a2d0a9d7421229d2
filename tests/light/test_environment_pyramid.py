"""The blurred light: a constant stays, a harmonic is damped as a Gaussian damps it, irradiance has its closed form."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.irradiance import RESOLUTION as IRRADIANCE
from rsibr.light.irradiance import irradiance_map
from tests.arrays import to_numpy, unit_vectors, vector

R = 128
AXIS = np.array([0.48, -0.6, 0.64])


def picture(function, resolution=R):
    """Octahedral image of `function`, (M, 3) → (M,) or (M, 3)."""
    values = function(to_numpy(texel_directions(resolution)).T)
    values = values if values.ndim == 2 else np.repeat(values[:, None], 3, axis=1)
    return values.reshape(resolution, resolution, 3).astype(np.float32)


def legendre(degree, cosine):
    return np.polynomial.legendre.legval(cosine, [0] * degree + [1])


def blurred(stack, d, width):
    return to_numpy(stack.blurred(vector(d), mi.Float(width))).T


@pytest.fixture(scope="module")
def harmonics():
    return {k: EnvironmentPyramid.of(picture(lambda d, k=k: 1 + 0.5 * legendre(k, d @ AXIS))) for k in (1, 2, 4, 8)}


def test_levels_are_root_two_apart_and_reach_the_widest(harmonics):
    widths = np.sqrt(to_numpy(harmonics[1].variances))
    assert widths[0] < 0.6 * np.sqrt(4 * np.pi) / R
    assert widths[2:] / widths[1:-1] == pytest.approx(np.full(len(widths) - 2, np.sqrt(2)), rel=1e-6)
    assert widths[-1] >= 1.3


@pytest.mark.parametrize("value", [1.0, 3.7e5, 0.0])
def test_a_constant_stays_constant(value, rng):
    stack = EnvironmentPyramid.of(np.full((R, R, 3), value, np.float32))
    d = np.concatenate([unit_vectors(rng, 2000), np.eye(3), -np.eye(3)])
    for width in (0.0, 1e-3, 0.05, 0.3, 1.3, 5.0):
        assert np.abs(blurred(stack, d, width) - value).max() <= 5e-7 * value  # of rounding in 14 blurs of 45 taps
        rough = to_numpy(stack.nearest_blurred(vector(d), mi.Float(width)))
        assert np.abs(rough - value).max() <= 5e-7 * value


@pytest.mark.parametrize("degree", [1, 2, 4, 8])
def test_a_harmonic_is_damped_as_a_gaussian_damps_it(harmonics, degree, rng):
    """exp(−l(l+1)σ²/2), the heat kernel; what is left has the harmonic's own shape. Texels differ in size by ±25 %."""
    d = unit_vectors(rng, 4000)
    shape = legendre(degree, d @ AXIS)
    for width in (0.06, 0.1, 0.2, 0.3, 0.5):
        got = blurred(harmonics[degree], d, width)[:, 0] - 1
        damping = (got @ shape) / (0.5 * shape @ shape)
        assert damping == pytest.approx(np.exp(-degree * (degree + 1) * width**2 / 2), rel=0.02, abs=0.012)
        assert np.abs(got - 0.5 * damping * shape).max() < 0.025


def test_a_blur_of_no_width_is_the_light_itself(rng):
    d = unit_vectors(rng, 2000)
    stack = EnvironmentPyramid.of(picture(lambda d: 1 + 0.5 * legendre(4, d @ AXIS), 256))
    assert np.abs(blurred(stack, d, 0.0)[:, 0] - 1 - 0.5 * legendre(4, d @ AXIS)).max() < 4e-3


def test_wider_is_never_sharper(harmonics):
    """The peak of a harmonic falls with every step of the width: across the joints of levels too."""
    widths = np.geomspace(1e-3, 2.0, 400)
    peak = to_numpy(harmonics[8].blurred(vector(np.tile(AXIS, (400, 1))), mi.Float(widths.astype(np.float32))))[0]
    assert (np.diff(peak) <= 1e-4).all()  # 2e-4 of the contrast: what is left of it at the widest
    assert np.diff(peak).min() > -0.02  # 1.9 % wider a step: no jump
    assert peak[0] > 1.49
    assert peak[-1] == pytest.approx(1, abs=2e-3)


def test_a_sun_keeps_its_energy_through_all_levels():
    """Within what texels of different size allow: the sum over the sphere of each level is that of the light."""
    light = np.full((R, R, 3), 0.01, np.float32)
    light[40, 77] = 1e5
    energy = float((texel_solid_angles(R) @ light.reshape(-1, 3))[0])
    stack = EnvironmentPyramid.of(light)
    d, angles = vector(to_numpy(texel_directions(256)).T), texel_solid_angles(256)
    for level in range(len(stack.resolutions)):
        assert angles @ to_numpy(stack.fetch(d, mi.UInt32(level)))[0] == pytest.approx(energy, rel=0.06)


# --- Irradiance -------------------------------------------------------------------------------------------------------

BARE, COATED = np.array([[1.0] * 3, [0.0] * 3]), np.array([[0.0] * 3, [1.0] * 3])
RATIO = {"bare": 2 / 3, "coated": (1 / 3 - 1 / 168) / (1 / 2 - 1 / 42)}
"""Of the first to the zeroth moment of c and of c(1 − (1 − c)⁵) over [0, 1]: ∫ c·w dc / ∫ w dc, with Beta functions."""


def irradiance(stack, n):
    return to_numpy(stack.fetch(vector(n), mi.UInt32(0))).T


@pytest.mark.parametrize(("kind", "weights"), [("bare", BARE), ("coated", COATED)])
def test_irradiance_of_a_gradient_has_its_closed_form(kind, weights, rng):
    """Under L = 1 + a·ω a cosine lobe sees 1 + (2/3) a·n, a coated one 1 + 0.6875 a·n."""
    stack = EnvironmentPyramid.of_irradiance(irradiance_map(picture(lambda d: 1 + d @ (0.9 * AXIS)), weights))

    def error(n):
        return np.abs(irradiance(stack, n)[:, 0] - 1 - RATIO[kind] * n @ (0.9 * AXIS))

    assert error(to_numpy(texel_directions(IRRADIANCE)).T).max() < 1e-3
    between = error(np.concatenate([unit_vectors(rng, 2000), np.eye(3), -np.eye(3)]))
    assert between.mean() < 1.5e-3
    assert between.max() < 0.02  # where the map is folded


def test_irradiance_of_a_constant_is_that_constant_in_every_mixture(rng):
    mixed = np.array([[0.3, 0.0, 0.0], [0.7, 0.2, 0.0]])  # the last channel is black: it needs a shape all the same
    stack = EnvironmentPyramid.of_irradiance(irradiance_map(np.full((R, R, 3), 2.5, np.float32), mixed))
    assert np.abs(irradiance(stack, unit_vectors(rng, 500)) / 2.5 - 1).max() < 5e-7


def test_irradiance_of_a_mixture_lies_between():
    light = picture(lambda d: 1 + d @ (0.9 * AXIS))
    bare, coated = (RATIO[kind] for kind in ("bare", "coated"))
    half = EnvironmentPyramid.of_irradiance(irradiance_map(light, BARE + COATED))
    shares = np.array([1 / 2, 1 / 2 - 1 / 42])  # what each sends back under an even sky
    expected = 1 + 0.9 * (shares @ [bare, coated]) / shares.sum()
    assert irradiance(half, AXIS[None])[0] == pytest.approx([expected] * 3, abs=3e-3)


def test_a_small_sun_lights_a_matte_surface_from_its_own_place():
    """Blocks of texels are lit from where their light comes from, not from their middle."""
    light = np.zeros((256, 256, 3), np.float32)
    light[100, 37] = 1.0
    sun = to_numpy(texel_directions(256)).T[100 * 256 + 37]
    stack = EnvironmentPyramid.of_irradiance(irradiance_map(light, BARE))
    n = to_numpy(texel_directions(IRRADIANCE)).T
    exact = np.maximum(n @ sun, 0) * texel_solid_angles(256)[100 * 256 + 37] / np.pi
    assert np.abs(irradiance(stack, n)[:, 0] - exact).max() < 3e-3 * exact.max()

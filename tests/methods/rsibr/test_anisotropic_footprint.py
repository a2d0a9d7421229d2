"""A streak of lookups has the variance of the Gaussian that it stands for, in the plane of incidence and across it."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.methods.rsibr.anisotropic_footprint import AnisotropicFootprint, ShadingFrame, tap_spreads
from tests.arrays import to_numpy, unit_vectors, vector
from tests.microfacet import viewer

COSINES = (0.995, 0.8, 0.5, 0.25, 0.12)


def shading(cosine):
    return ShadingFrame.of(mi.Vector3f(0, 0, 1), mi.Vector3f(*viewer(cosine).tolist()))


def squared_angles(cosine):
    """A light that is the square of an angle to the mirror direction, in the plane and across: a blur adds its own."""
    surface = shading(cosine)
    r = mi.Vector3f(-np.sqrt(1 - cosine**2).item(), 0, cosine)
    within, across = mi.Vector3f(cosine, 0, np.sqrt(1 - cosine**2).item()), mi.Vector3f(0, 1, 0)

    def squared(d, width):
        local = mi.Vector3f(dr.dot(d, surface.x), dr.dot(d, surface.y), d.z)
        along = dr.atan2(dr.dot(local, within), dr.dot(local, r))
        return mi.Color3f(along * along + width * width, dr.square(dr.dot(local, across)) + width * width, 0)

    return surface, squared


def spread(cosine, sigma, spacing=0.0):
    """Standard deviations of a streak in its plane and across it, its blurs included, and the weight."""
    surface, squared = squared_angles(cosine)

    def colour(facet):
        return 2 * dr.dot(facet, surface.v) * facet - surface.v, mi.Color3f(1)

    streak = AnisotropicFootprint.of(surface, mi.Float(sigma), mi.Float(spacing))
    light, weight = streak.gather(tap_spreads(), colour, squared)
    return np.sqrt(to_numpy(light)[:2, 0]), to_numpy(weight)[0, 0]


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize("sigma", [1e-3, 0.02])
def test_it_is_twice_sigma_wide_in_the_plane_and_the_cosine_of_that_across(cosine, sigma):
    (along, across), weight = spread(cosine, sigma)
    assert weight == pytest.approx(1, rel=1e-5)
    assert along == pytest.approx(2 * sigma, rel=0.02)
    assert across == pytest.approx(2 * sigma * cosine, rel=0.02)


@pytest.mark.parametrize("cosine", [0.995, 0.8, 0.5, 0.3])  # beyond, 24 lookups leave the streak too wide across
def test_a_mirror_is_seen_through_the_texel(cosine):
    """A texel of spacing s has the variance s²/12 of a box, and spans 1/cos θ as many normals toward the rim."""
    spacing = 0.01
    (along, across), _ = spread(cosine, 0.0, spacing)
    box = spacing / np.sqrt(12)
    assert along == pytest.approx(2 * box / cosine, rel=0.02)
    assert across == pytest.approx(2 * box * cosine, rel=0.02)


def test_a_point_sees_a_mirror_sharp():
    (along, across), _ = spread(0.5, 0.0)
    assert along == pytest.approx(0, abs=1e-6)
    assert across == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("cosine", COSINES)
def test_three_taps_have_the_variance_in_the_plane(cosine):
    """Gauss and Hermite's rule; a long streak is bridged by the blur of its lookups, which adds a quarter to it."""
    surface, squared = squared_angles(cosine)
    streak = AnisotropicFootprint.of(surface, mi.Float(0.02), mi.Float(0))
    sigma_along = to_numpy(streak.along)[0]
    blur = max(2 * 0.02 * cosine, 0.5 * sigma_along)
    along, across = np.sqrt(to_numpy(streak.three_taps(squared))[:2, 0])
    assert along == pytest.approx(np.hypot(2 * sigma_along, blur), rel=0.02)
    assert 0.04 * 0.995 < along < 0.04 * 1.04
    assert across == pytest.approx(blur, rel=0.03)


def test_three_taps_of_an_even_light_are_that_light():
    surface, _ = squared_angles(0.12)
    streak = AnisotropicFootprint.of(surface, mi.Float(0.1), mi.Float(0))
    assert to_numpy(streak.three_taps(lambda _d, _width: mi.Color3f(2.5)))[:, 0] == pytest.approx([2.5] * 3, rel=1e-6)


def test_three_taps_are_weighed_by_the_projected_area_of_their_facets():
    """Places ±√3 σ with a sixth each, and twice that in the middle, times h·v; by hand in float64."""
    cosine, sigma = 0.5, 0.1
    surface, _ = squared_angles(cosine)
    streak = AnisotropicFootprint.of(surface, mi.Float(sigma), mi.Float(0))
    slopes = np.array([-1, 0, 1]) * np.sqrt(3) * to_numpy(streak.along)[0]
    h = np.stack([slopes, 0 * slopes, np.ones(3)], axis=1) / np.sqrt(1 + slopes**2)[:, None]
    v = viewer(cosine)
    weight = (h @ v) * [1 / 6, 2 / 3, 1 / 6]
    heights = (2 * (h @ v)[:, None] * h - v)[:, 2]
    found = to_numpy(streak.three_taps(lambda d, _width: mi.Color3f(d.z)))[0, 0]
    assert found == pytest.approx(weight @ heights / weight.sum(), rel=1e-5)


def test_three_taps_of_a_mirror_are_one():
    surface, _ = squared_angles(0.5)
    mirrored = AnisotropicFootprint.of(surface, mi.Float(0), mi.Float(0)).three_taps(
        lambda d, width: mi.Color3f(d.x, d.z, width)
    )
    assert to_numpy(mirrored)[:, 0] == pytest.approx([-np.sqrt(0.75), 0.5, 0], abs=1e-6)


@pytest.mark.parametrize("cosine", [0.995, 0.6, 0.2])
def test_the_frame_in_a_map_is_that_of_the_surface(cosine):
    """`in_map` takes its tangents from the map; `of` from the vectors themselves."""
    frame = view_frame([0.3, -0.5, 0.8])
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    sine = np.sqrt(1 - cosine**2)
    local = np.stack([sine * np.cos(turn), sine * np.sin(turn), np.full(12, cosine)], axis=1)
    in_map = ShadingFrame.in_map(vector(local), mi.Matrix3f(frame.astype(np.float32)))
    of = ShadingFrame.of(vector(local @ frame.T), vector(np.tile(frame[:, 2], (12, 1))))
    for name in ("n", "x", "y", "v"):
        assert np.abs(to_numpy(getattr(in_map, name)) - to_numpy(getattr(of, name))).max() < 2e-6, name


def test_a_slant_is_an_orthonormal_frame_with_the_viewer_in_its_plane(rng):
    n, v = unit_vectors(rng, 2000), unit_vectors(rng, 2000)
    v *= np.sign((n * v).sum(1, keepdims=True))
    v[:3], v[3:6] = n[:3], n[3:6] + 1e-6  # head-on, where every plane is one of incidence
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    made = ShadingFrame.of(vector(n), vector(v))
    frame = np.stack([to_numpy(axis).T for axis in (made.x, made.y, made.n)], axis=2)
    assert np.abs(np.swapaxes(frame, 1, 2) @ frame - np.eye(3)).max() < 3e-5
    far = (n * v).sum(1) > 1e-2
    assert np.abs(to_numpy(made.to_world(made.v)).T - v)[far].max() < 1e-5

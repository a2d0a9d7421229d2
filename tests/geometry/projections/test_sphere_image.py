"""Conversion between projections: means when minifying, bilinear when magnifying, energy, and every pair."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.projection import projection, projection_names
from rsibr.geometry.projections.sphere_image import SphereImage, converted, texel_directions, texel_solid_angles
from tests.arrays import to_numpy, unit_vectors, vector
from tests.geometry.projections.projected import sampled, smooth

WHOLE = [name for name in projection_names() if name != "sphere-map"]


@pytest.mark.parametrize("name", WHOLE)
def test_a_constant_stays(name):
    image = SphereImage(projection("octahedral"), np.full((1, 32, 32, 3), 0.7))
    for size in (5, 48):
        assert np.abs(converted(image, projection(name), size).values - 0.7).max() < 1e-5


@pytest.mark.parametrize("name", WHOLE)
def test_means_of_larger_texels_keep_the_energy(name):
    """White noise: the mean over the sphere stays, within the 1 % that samples of two a texel miss."""
    noise = np.random.default_rng(7).random((1, 64, 64, 3))
    image = SphereImage(projection("octahedral"), noise)
    assert converted(image, projection(name), 8).mean() == pytest.approx(image.mean(), rel=0.01)


def test_the_same_projection_and_size_is_the_same_image():
    image = sampled("cube", 8)
    assert converted(image, projection("cube"), 8) is image


def test_magnified_texels_are_bilinear_samples():
    image, to = sampled("cube", 8), projection("latlong")
    finer = converted(image, to, 65)
    assert np.array_equal(finer.values.reshape(-1, 3), to_numpy(image.lookup(texel_directions(to, 65))).T)


@pytest.mark.parametrize("name", WHOLE)
def test_a_direction_that_is_none_ends_nothing(name):
    d = mi.Vector3f([0.0, np.nan], [0.0, 1.0], [0.0, 0.0])
    image = SphereImage(projection(name), np.ones((projection(name).sheets, 4, 4, 3)))
    assert to_numpy(image.lookup(d)).shape == to_numpy(image.nearest(d)).shape == (3, 2)


def test_a_hemisphere_is_not_converted():
    with pytest.raises(ValueError, match="hemisphere"):
        converted(sampled("sphere-map", 8), projection("cube"), 8)


def test_values_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"cube takes values \(6, H, W, 3\)"):
        SphereImage(projection("cube"), np.zeros((5, 8, 8, 3)))


def round_trip(name, other, size=16):
    """Errors of a smooth radiance after one lookup in each projection, and after going there and back, on average."""
    d = unit_vectors(np.random.default_rng(5), 3000)
    there = converted(sampled(name, size), projection(other), size)
    back = converted(there, projection(name), size)
    images = sampled(name, size), sampled(other, size), back
    return [np.abs(to_numpy(one.lookup(vector(d))).T - smooth(d)).mean() for one in images]


@pytest.mark.parametrize("name", WHOLE)
def test_a_round_trip_through_a_cube_loses_what_its_lookups_lose(name):
    own, other, both = round_trip(name, "cube")
    assert both < BOUND * (own + other)


@pytest.mark.slow
@pytest.mark.parametrize("other", WHOLE)
@pytest.mark.parametrize("name", WHOLE)
def test_a_round_trip_through_any_pair_loses_what_its_lookups_lose(name, other):
    own, there, both = round_trip(name, other)
    assert both < BOUND * (own + there)


BOUND = 2.5
"""Each conversion costs a lookup, and where it minifies the box of a texel besides; the last lookup one more."""


def test_the_middle_of_a_cubes_face_is_coarser_than_its_corners():
    """Miller & Hoffman (1984), section 4.1, state a third of the resolution, from an area that goes with 1/z².

    The solid angle goes with z³ = (1+u²+v²)^(−3/2): from the middle to a corner by 3√3 = 5.2, or 2.3 along a side.
    A third is right of the radial spacing alone.
    """
    angles = texel_solid_angles(projection("cube"), 256)[0]
    middle, corner = angles[128, 128], angles[0, 0]
    assert middle / corner == pytest.approx(3**1.5, rel=0.02)
    assert np.sqrt(middle / corner) == pytest.approx(2.28, abs=0.03)
    d = to_numpy(texel_directions(projection("cube"), 256)).T.reshape(6, 256, 256, 3)[0]
    radial = [np.linalg.norm(d[i, i] - d[i + 1, i + 1]) for i in (0, 128)]
    assert radial[1] / radial[0] == pytest.approx(3.0, rel=0.02)
    edge = angles[128, 0]
    assert middle / edge == pytest.approx(2**1.5, rel=0.02)

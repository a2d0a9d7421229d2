"""Conversion between projections: means when minifying, bilinear when magnifying, energy, and every pair."""

import numpy as np
import pytest

from rsibr.geometry.projections.projection import projection, projection_names
from rsibr.geometry.projections.sphere_image import SphereImage, converted, texel_directions
from tests.arrays import to_numpy
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


def test_a_hemisphere_is_not_converted():
    with pytest.raises(ValueError, match="hemisphere"):
        converted(sampled("sphere-map", 8), projection("cube"), 8)


def test_values_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"cube takes values \(6, H, W, 3\)"):
        SphereImage(projection("cube"), np.zeros((5, 8, 8, 3)))

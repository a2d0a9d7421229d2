"""HDR-FLIP at pinned exposures."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.validation.flip import exposures_for, flip_map
from tests.validation.doubles import smooth_map


def test_exposures_scale_with_the_scene():
    one, eight = exposures_for(1.0), exposures_for(8.0)
    assert (one.start - eight.start, one.stop - eight.stop) == pytest.approx((3, 3))
    assert one.start < one.stop


def test_a_scene_and_its_brighter_copy_differ_alike():
    a, b = smooth_map(), smooth_map()[:, ::-1]
    here = flip_map(a, b, exposures_for(1.0))
    there = flip_map(16 * a, 16 * b, exposures_for(16.0))
    np.testing.assert_allclose(here, there, atol=1e-5)


def test_a_difference_is_where_it_is():
    test = smooth_map(64)
    test[10:20, 40:50] = 4.0
    difference = flip_map(smooth_map(64), test, exposures_for(1.0))
    assert difference[12:18, 42:48].min() > 0.3
    assert difference[40:, :20].max() == 0
    assert difference.shape == (64, 64)
    assert 0 <= difference.min() <= difference.max() <= 1


def test_pinned_exposures_do_not_depend_on_the_reference():
    # Left to itself FLIP would choose another range once a sun stands in both pictures.
    a, b = smooth_map(64), 1.3 * smooth_map(64)
    with_sun = [image.copy() for image in (a, b)]
    for image in with_sun:
        image[:2, :2] = 1e5
    one, two = flip_map(a, b, exposures_for(1.0)), flip_map(*with_sun, exposures_for(1.0))
    np.testing.assert_allclose(one[32:, 32:], two[32:, 32:], atol=1e-6)


def test_negative_radiance_is_black():
    a = smooth_map()
    np.testing.assert_array_equal(flip_map(a, -a, exposures_for(1.0)), flip_map(a, 0 * a, exposures_for(1.0)))


@pytest.mark.parametrize("which", [0, 1])
def test_not_finite_raises(which):
    images = [smooth_map(), smooth_map()]
    images[which][3, 3, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        flip_map(*images, exposures_for(1.0))


def test_a_black_reference_does_not_end_the_process():
    black = np.zeros((16, 16, 3), dtype=np.float32)
    assert flip_map(black, black, exposures_for(0.0)).max() == 0
    assert flip_map(black, black + 1, exposures_for(0.0)).min() > 0


@pytest.mark.parametrize("mean", [1e-3, 0.18, 1.0, 5e4])
def test_the_mean_is_shown_as_middle_grey_between_the_exposures(mean):
    """Of the mean radiance, 0.18 is 4 stops above the first exposure and 2 below the last; one every 2 stops."""
    exposures = exposures_for(mean)
    assert mean * 2 ** (exposures.start + 4) == pytest.approx(0.18)
    assert mean * 2 ** (exposures.stop - 2) == pytest.approx(0.18)
    assert (exposures.stop - exposures.start) / (exposures.count - 1) == pytest.approx(2)

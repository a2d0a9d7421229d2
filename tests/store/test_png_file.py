"""Radiance as 8-bit sRGB; the curve itself is tested with the pictures of reports."""

import numpy as np
import pytest
from matplotlib.image import imread

from rsibr.store.png_file import exposure_of, to_bytes, tone_mapped, write_png


def test_the_exposure_takes_the_95th_percentile_to_four_fifths():
    values = np.arange(101.0)
    assert exposure_of(values) == pytest.approx(0.8 / 95)
    assert exposure_of(np.append(values, [np.nan, np.inf])) == pytest.approx(0.8 / 95)


@pytest.mark.parametrize("values", [[], [0.0], [np.nan]])
def test_what_is_black_or_nothing_has_exposure_1(values):
    assert exposure_of(np.array(values)) == 1.0


def test_a_file_holds_the_bytes(tmp_path):
    rgba = np.random.default_rng(1).integers(0, 256, (3, 4, 4)).astype(np.uint8)
    write_png(tmp_path / "a.png", rgba)
    np.testing.assert_array_equal(np.rint(imread(tmp_path / "a.png") * 255), rgba)
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


def test_nan_and_infinity_have_a_colour():
    np.testing.assert_array_equal(to_bytes(np.array([np.nan, np.inf, -np.inf])), [0, 255, 0])
    image = np.array([[[np.nan, np.inf, -1.0]]])
    np.testing.assert_array_equal(tone_mapped(image, np.ones((1, 1)), 1.0)[0, 0], [0, 255, 0, 255])

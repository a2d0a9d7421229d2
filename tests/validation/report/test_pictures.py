"""Pictures: the right colour, scale, opacity and bytes."""

from __future__ import annotations

import io

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.image import imread

from rsibr.validation.reference import Reference
from rsibr.validation.report.pictures import (
    COLOUR_MAP,
    FLIP,
    RELATIVE_ERROR,
    bar_colours,
    display_exposure,
    false_colour,
    png,
    shrunk,
    tone_mapped,
)
from tests.validation.doubles import disk, smooth_map


def test_srgb_encodes_as_the_standard_says():
    # IEC 61966-2-1: linear 0.2159 is 128 of 255, 0.0031308 the joint of its two pieces, 18 % grey is 118.
    linear = np.array([0.0, 0.0031308, 0.18, 0.2159, 1.0, 7.0])
    picture = tone_mapped(np.repeat(linear[None, :, None], 3, axis=2), np.ones((1, 6)), exposure=1.0)
    assert picture[0, :, 0].tolist() == [0, 10, 118, 128, 255, 255]


def test_exposure_scales_and_negative_radiance_is_black():
    image = np.array([[[0.25, -1.0, 1e30]]])
    assert tone_mapped(image, np.ones((1, 1)), exposure=4.0)[0, 0].tolist() == [255, 0, 255, 255]


def test_coverage_is_opacity_and_hides_what_it_does_not_cover():
    image = np.full((1, 3, 3), 0.5)
    image[0, 0] = np.nan
    picture = tone_mapped(image, np.array([[0.0, 0.5, 1.0]]), exposure=1.0)
    assert picture[0, :, 3].tolist() == [0, 128, 255]
    assert picture[0, 0].tolist() == [0, 0, 0, 0]


def test_one_exposure_shows_the_bright_part_below_white():
    reference = Reference(np.stack([smooth_map()] * 8), disk(), samples=8, seconds=1.0)
    exposure = display_exposure([reference])
    shown = smooth_map()[disk() > 0].max(axis=-1) * exposure
    assert np.mean(shown < 0.8) == pytest.approx(0.95, abs=0.03)  # the ramp has few levels
    black = Reference(np.zeros((8, 32, 32, 3), dtype=np.float32), disk(), samples=8, seconds=1.0)
    assert display_exposure([black]) == 1.0


def test_a_logarithmic_scale_gives_each_decade_the_same_length():
    assert RELATIVE_ERROR.position(np.array([1e-3, 1e-2, 1e-1, 1.0])) == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert RELATIVE_ERROR.position(np.array([0.0, 50.0])) == pytest.approx([0, 1])
    assert FLIP.position(0.25) == 0.25


def test_ticks_lie_on_the_bar():
    for scale in (RELATIVE_ERROR, FLIP):
        places = [float(scale.position(value)) for value, _ in scale.ticks]
        assert places == sorted(places)
        assert (places[0], places[-1]) == (0, 1)


def test_false_colour_is_the_bar_and_nan_is_transparent():
    values = np.array([[0.0, 0.5, 1.0, np.nan]])
    picture = false_colour(values, FLIP)
    expected = np.rint(colormaps[COLOUR_MAP]([0.0, 0.5, 1.0]) * 255)
    np.testing.assert_array_equal(picture[0, :3], expected)
    assert picture[0, 3, 3] == 0
    colours = bar_colours(3)
    assert colours == ["#" + "".join(f"{int(c):02x}" for c in colour[:3]) for colour in expected]


def test_png_holds_the_same_bytes(rng):
    picture = rng.integers(0, 256, (5, 7, 4), dtype=np.uint8)
    decoded = np.rint(imread(io.BytesIO(png(picture)), format="png") * 255)
    np.testing.assert_array_equal(decoded, picture)


def test_shrinking_averages_and_does_not_bleed_from_outside():
    picture = np.zeros((4, 4, 4), dtype=np.uint8)
    picture[:, 1:] = [200, 100, 0, 255]  # the first column is transparent black
    small = shrunk(picture, 2)
    assert small.shape == (2, 2, 4)
    assert small[0, 0].tolist() == [200, 100, 0, 128]
    assert small[0, 1].tolist() == [200, 100, 0, 255]
    assert shrunk(picture, 4) is picture


def test_shrinking_takes_odd_sizes():
    assert shrunk(np.full((9, 9, 4), 255, dtype=np.uint8), 4).shape == (3, 3, 4)
    assert (shrunk(np.full((9, 7, 4), 255, dtype=np.uint8), 5) == 255).all()

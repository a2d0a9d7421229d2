"""One tone curve for pictures of very different brightness."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.batches.gallery.tone_curve import BRIGHT, DARK, ToneCurve


def picture(level, rng, sun=0.0):
    """A smooth picture around a level of radiance, with a sun of one texel."""
    made = level * rng.uniform(0.5, 1.5, (24, 24, 3))
    made[3, 4] += sun
    return made


def test_pictures_of_like_brightness_are_shown_linearly(rng):
    pictures = [picture(level, rng) for level in (0.7, 1.0, 2.0)]
    curve = ToneCurve.of(pictures)
    assert curve.contrast == 0
    assert curve(pictures[1]) == pytest.approx(np.minimum(pictures[1] / curve.white, 1))
    shown = curve(pictures[2]).max(axis=-1)
    assert np.percentile(shown, 95) == pytest.approx(BRIGHT, rel=1e-6)


def test_a_night_and_a_sun_of_1e5_in_one_sheet_are_both_legible(rng):
    night, noon = picture(3e-4, rng), picture(5.0, rng, sun=1e5)
    curve = ToneCurve.of([night, noon])
    assert curve.white < 20  # one texel of sun does not set the white
    dark, bright = (curve(one).max(axis=-1) for one in (night, noon))
    assert np.percentile(dark, 75) == pytest.approx(DARK, rel=1e-6)
    assert np.median(bright) > 0.5
    assert bright[3, 4] == pytest.approx(1)
    assert dark.std() > 0.003  # the night's own structure, a level of 8 bits and more
    assert curve.stops >= np.log2(5 / 3e-4)


def test_the_same_radiance_has_one_colour_and_no_colour_fades():
    red = np.array([[[1.0, 0.1, 0.05]]])
    curve = ToneCurve.of([red * 1e-4, red * 100])
    assert curve.contrast > 1
    for scale in (1e-4, 1e-2, 1.0):
        shown = curve(red * scale)[0, 0]
        assert shown[1:] / shown[0] == pytest.approx([0.1, 0.05])
    levels = [curve(red * scale).max() for scale in np.geomspace(1e-5, 100, 30)]
    assert (np.diff(levels) > 0).all()


@pytest.mark.parametrize("broken", [np.nan, np.inf, 1e30])
def test_broken_and_black_pictures_decide_nothing(rng, broken):
    good = [picture(level, rng) for level in (0.5, 1.0, 1.5)]
    spoilt = np.full((24, 24, 3), broken)
    assert ToneCurve.of([*good, spoilt, np.zeros((4, 4, 3))]) == ToneCurve.of(good)
    assert np.isfinite(ToneCurve.of(good)(spoilt)).all()


def test_nothing_to_see_is_shown_as_it_is():
    assert ToneCurve.of([np.zeros((2, 2, 3))])(np.full((1, 1, 3), 0.5)) == pytest.approx(0.5)
    assert ToneCurve.of([]).white == 1

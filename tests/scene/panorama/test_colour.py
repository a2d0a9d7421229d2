"""Colours that a header states, against colour-science."""

from __future__ import annotations

import colour
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.scene.panorama.colour import REC709, XYZ, rec709_matrix, to_rec709
from rsibr.scene.panorama.picture import Picture

SPACES = ["ACEScg", "ACES2065-1", "ITU-R BT.2020", "Display P3", "ProPhoto RGB", "Adobe RGB (1998)"]


def stated(name):
    space = colour.RGB_COLOURSPACES[name]
    return (*space.primaries.ravel(), *space.whitepoint)


@pytest.mark.parametrize("name", SPACES)
def test_every_colour_is_converted_as_colour_science_does(rng, name):
    source, target = (colour.RGB_COLOURSPACES[key].copy() for key in (name, "sRGB"))
    source.use_derived_transformation_matrices(True)
    target.use_derived_transformation_matrices(True)
    colours = rng.random((50, 3))
    expected = colour.RGB_to_RGB(colours, source, target, "Bradford")
    np.testing.assert_allclose(colours @ rec709_matrix(stated(name)).T, expected, atol=1e-9)


@pytest.mark.parametrize("name", SPACES)
def test_grey_stays_grey(name):
    picture = Picture(np.full((1, 1, 3), 0.5, np.float32), chromaticities=stated(name))
    image, notes = to_rec709(picture, "")
    np.testing.assert_allclose(image, 0.5, rtol=1e-6)
    assert ("adapted to D65" in notes[0]) == (stated(name)[6:] != tuple(REC709[6:]))


def test_the_neutral_colour_takes_the_place_of_the_white():
    """A colour of xy equal to adoptedNeutral becomes neutral, whatever the white."""
    d50 = (0.34567, 0.35850)
    warm = np.linalg.inv(colour.normalised_primary_matrix(np.reshape(REC709[:6], (3, 2)), np.array(REC709[6:])))
    warm = warm @ colour.xy_to_XYZ(np.array(d50))
    picture = Picture(warm.astype(np.float32).reshape(1, 1, 3), chromaticities=REC709, neutral=d50)
    np.testing.assert_allclose(to_rec709(picture, "")[0], 1.0, rtol=1e-5)


@pytest.mark.parametrize("picture", [{"xyz": True}, {"chromaticities": XYZ}])
def test_xyz_is_converted_without_adaptation(rng, picture):
    colours = rng.random((4, 5, 3))
    xyz = colours @ colour.normalised_primary_matrix(np.reshape(REC709[:6], (3, 2)), np.array(REC709[6:])).T
    image, notes = to_rec709(Picture(xyz.astype(np.float32), **picture), "")
    np.testing.assert_allclose(image, colours, atol=1e-6)
    assert "XYZ" in notes[0]


@pytest.mark.parametrize("chromaticities", [None, REC709, (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.31271, 0.32902)])
def test_rec709_is_left_bit_for_bit(rng, chromaticities):
    image = rng.random((2, 3, 3)).astype(np.float32)
    read, notes = to_rec709(Picture(image, chromaticities=chromaticities, neutral=(0.3127, 0.329)), "")
    assert read is image
    assert notes == ()


@pytest.mark.parametrize(
    "chromaticities",
    [
        (0.64, 0.33, 0.64, 0.33, 0.15, 0.06, 0.3127, 0.3290),  # two equal
        (0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.3127, 0.3290),  # on a line
        (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.0),
        (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.7, 0.25),  # white outside the triangle
        (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, -0.3127, 0.3290),
        (np.nan, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290),
        (0.64, 0.33, 0.30, 0.60, 0.15, np.inf, 0.3127, 0.3290),
        (0.0,) * 8,
        (1e30,) * 8,
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_defines_no_colours_is_refused(chromaticities):
    with pytest.raises(InputError, match=r"^sky: states") as caught:
        to_rec709(Picture(np.ones((1, 1, 3), np.float32), chromaticities=chromaticities), "sky")
    assert "\n" not in str(caught.value)

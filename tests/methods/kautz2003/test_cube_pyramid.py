"""Levels, lookups and borders of the box-filtered cube."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.methods.kautz2003 import claims
from rsibr.methods.kautz2003.cube_pyramid import CubePyramid
from rsibr.methods.kautz2003.faces import bordered, box_levels, checked
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.kautz2003.skies import directions, faces_of

SIZE = 16


@pytest.fixture
def noise(rng):
    return rng.random((6, SIZE, SIZE, 3), dtype=np.float32)


def seen(levels, d, level, *, seams=True):
    return to_numpy(CubePyramid.of(levels, seams=seams).lookup(vector(d), mi.Float(level))).T


def test_each_level_holds_the_means_of_its_face_alone(noise):
    levels = box_levels(noise)
    assert [level.shape[1] for level in levels] == [16, 8, 4, 2, 1]
    assert levels[-1][:, 0, 0] == pytest.approx(noise.mean(axis=(1, 2)), abs=1e-6)
    assert levels[2][3, 1, 2] == pytest.approx(noise[3, 4:8, 8:12].mean(axis=(0, 1)), abs=1e-6)


@pytest.mark.parametrize("seams", [False, True])
def test_lookups_at_texel_centres_are_the_texels(noise, seams):
    d = directions(SIZE).reshape(-1, 3)
    assert seen([noise], d, 0.0, seams=seams) == pytest.approx(noise.reshape(-1, 3), abs=2e-5)


def test_between_two_levels_lookups_are_linear(noise, rng):
    levels, d = box_levels(noise), unit_vectors(rng, 200)
    one, other = seen(levels, d, 2.0), seen(levels, d, 3.0)
    assert seen(levels, d, 2.25) == pytest.approx(0.75 * one + 0.25 * other, abs=1e-5)
    assert seen(levels, d, 9.4) == pytest.approx(seen(levels, d, 4.0))


@pytest.mark.parametrize("seams", [False, True])
def test_a_constant_stays_constant_everywhere(seams, rng):
    levels, d = box_levels(np.full((6, 8, 8, 3), 0.7, np.float32)), unit_vectors(rng, 500)
    for level in (0.0, 1.5, 3.0):
        assert seen(levels, d, level, seams=seams) == pytest.approx(0.7, abs=1e-6)


def test_borders_hold_the_texels_across_each_edge():
    """The radiance there is that of the direction just beyond, on a map that tells all directions apart."""
    own = directions(SIZE)[..., 0, :]
    wide = bordered(own.astype(np.float32), seams=True)
    for edge, inner in ((wide[:, 0, 1:-1], own[:, 0]), (wide[:, 1:-1, -1], own[:, :, -1])):
        apart = np.arccos((edge * inner).sum(axis=-1))  # a texel at an edge is 0.04 to 0.13 wide
        assert apart.min() > 0.04
        assert apart.max() < 0.14
    repeated = bordered(own.astype(np.float32), seams=False)
    assert (repeated[:, 0, 1:-1] == own[:, 0].astype(np.float32)).all()


def test_at_a_corner_three_faces_agree(noise):
    corner = np.array([[1, 1, 1.0]]) / np.sqrt(3)
    beside = corner + 1e-6 * np.eye(3)
    three = seen([noise], beside, 0.0)
    assert np.ptp(three, axis=0).max() < 1e-4
    # Mean of the texels that meet: px, py and pz at +X +Y +Z
    assert three[0] == pytest.approx((noise[0, 0, 0] + noise[2, -1, -1] + noise[4, 0, -1]) / 3, abs=1e-4)


@pytest.mark.parametrize("level", [1.0, 2.5, 4.0])
def test_faces_show_at_their_borders_without_the_cure_and_not_with_it(noise, level):
    """Figure 4: at the last level six different values meet."""
    assert claims.border_step(noise, level, borders=False) > 0.05
    assert claims.border_step(noise, level, borders=True) < 1e-4


def test_a_mirror_shows_the_environment(rng):
    d = unit_vectors(rng, 500)
    axes = rng.normal(size=(3, 3))
    faces = faces_of(lambda w: 2 + np.sin(w @ axes), 128)
    assert seen(box_levels(faces), d, 0.0) == pytest.approx(2 + np.sin(d @ axes), abs=2e-3)


def test_faces_of_a_wrong_shape_are_refused():
    for shape in ((6, 8, 8), (5, 8, 8, 3), (6, 8, 4, 3), (6, 12, 12, 3)):
        with pytest.raises(InputError, match="power of two"):
            checked(np.zeros(shape))


@pytest.mark.parametrize(("place", "xy"), [("centre", (0.0, 0.0)), ("edge", (0.9, 0.0)), ("corner", (0.9, 0.9))])
def test_the_kernel_is_narrower_toward_the_corners(place, xy, rng):
    """Mean square of the angle, 1 − P_1 = θ²/2, from lookups of linear maps; averaged over the places in a texel."""
    size, bias = 64, 2.0
    x, y = (c + rng.uniform(-1, 1, 2000) * 2**bias / size for c in xy)
    d = np.stack([x, y, np.ones_like(x)], axis=1)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    mean = seen(box_levels(faces_of(lambda w: w, size)), d, bias)  # mean direction in the kernel
    # Half the sum of both variances; its axes differ by √(1 + x² + y²)
    width = np.sqrt((1 - (mean * d).sum(axis=1)).mean())
    squared = xy[0] ** 2 + xy[1] ** 2
    geometric = claims.kernel_widths(size, bias)["centre"] * (1 + squared) ** -0.75
    uneven = (1 + squared) ** 0.25  # root of the ratio of the axes
    assert width == pytest.approx(geometric * np.sqrt((uneven**2 + uneven**-2) / 2), rel=0.05)
    if place == "corner":
        told = claims.kernel_widths(size, bias)
        assert told["centre"] / told["corner"] == pytest.approx(3**0.75)

"""The octahedral map: an inverse both ways, all of the sphere, and no seam where it folds back on itself."""

from itertools import pairwise

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.octahedral import (
    bordered,
    direction_from_square,
    square_from_direction,
    texel_directions,
    texel_solid_angles,
)
from tests.arrays import point, to_numpy, unit_vectors, vector

AXES = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0.6, 0.8], [-0.6, 0, -0.8]]


def smooth(d):
    """Three harmonics of the direction (..., 3), none alike in two octants."""
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack([1 + x, y + 0.5 * x * z, z * z + 0.3 * x * y], axis=-1)


def picture(resolution):
    """`smooth` over the texels, (R, R, 3)."""
    d = to_numpy(texel_directions(resolution)).T
    return smooth(d).reshape(resolution, resolution, 3).astype(np.float32)


def bilinear(image, p):
    """Lookup at points of [−1, 1]² in a bordered image, in float64 and without the code under test."""
    place = (p + 1) * (len(image) - 2) / 2 + 0.5
    corner = np.floor(place).astype(int)
    (right, down) = (place - corner).T[..., None]
    column, row = corner.T
    upper = image[row, column] * (1 - right) + image[row, column + 1] * right
    lower = image[row + 1, column] * (1 - right) + image[row + 1, column + 1] * right
    return upper * (1 - down) + lower * down


def test_direction_and_square_are_inverse_both_ways(rng):
    d = np.concatenate([unit_vectors(rng, 10_000), AXES])
    assert np.abs(to_numpy(direction_from_square(square_from_direction(vector(d)))).T - d).max() < 3e-7
    p = rng.uniform(-1, 1, (10_000, 2))
    assert np.abs(to_numpy(square_from_direction(direction_from_square(point(p)))).T - p).max() < 5e-7


def test_directions_of_any_length_have_the_same_point(rng):
    d = unit_vectors(rng, 1000)
    assert (
        np.abs(to_numpy(square_from_direction(vector(7 * d))) - to_numpy(square_from_direction(vector(d)))).max() < 3e-7
    )


def test_z_is_in_the_middle_and_its_opposite_in_the_corners():
    assert np.abs(to_numpy(square_from_direction(mi.Vector3f(0, 0, 1)))).max() == 0
    corners = to_numpy(direction_from_square(point([[-1, -1], [1, -1], [-1, 1], [1, 1]]))).T
    assert np.abs(corners - [0, 0, -1]).max() < 1e-6


@pytest.mark.parametrize("resolution", [8, 9, 64])
def test_solid_angles_are_those_of_the_texels(resolution):
    """They sum to 4π; each is, to second order, the area of the two triangles on the sphere that make up the texel."""
    angles = texel_solid_angles(resolution)
    assert angles.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    corners = [
        to_numpy(texel_directions(resolution, right, down)).T for right, down in ((0, 0), (1, 0), (1, 1), (0, 1))
    ]
    exact = _triangle(corners[0], corners[1], corners[2]) + _triangle(corners[0], corners[2], corners[3])
    within = _within_one_octant(resolution)
    assert np.abs(angles / exact - 1)[within].max() < 8 / resolution**2


def _triangle(a, b, c):
    volume = (a * np.cross(b, c)).sum(axis=1)
    return 2 * np.arctan2(np.abs(volume), 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1))


def _within_one_octant(resolution):
    """Texels that no fold of the map crosses: there two triangles with great circles for sides are the texel."""
    low = np.arange(resolution) * 2 / resolution - 1
    x, y = np.meshgrid(low, low)
    step = 2 / resolution
    corners = [np.abs(x + i * step) + np.abs(y + j * step) - 1 for i in (0, 1) for j in (0, 1)]
    inside = np.all([c <= 1e-9 for c in corners], axis=0) | np.all([c >= -1e-9 for c in corners], axis=0)
    axis = ((x < -1e-9) & (x + step > 1e-9)) | ((y < -1e-9) & (y + step > 1e-9))
    return (inside & ~axis).ravel()


def test_a_border_holds_what_lies_beyond_the_edges():
    """Point by point: a border texel's direction, from the map continued by a half turn about the edge's middle."""
    resolution = 8
    framed = bordered(picture(resolution))
    for row in range(1, resolution + 1):
        mirrored = resolution + 1 - row
        assert np.array_equal(framed[row, 0], framed[mirrored, 1])
        assert np.array_equal(framed[row, -1], framed[mirrored, -2])
        assert np.array_equal(framed[0, row], framed[1, mirrored])
        assert np.array_equal(framed[-1, row], framed[-2, mirrored])


@pytest.mark.parametrize("resolution", [8, 64])
def test_a_lookup_has_no_seam(resolution, rng):
    """Points on either side of the fold, the same to rounding: edges, and the corners where all four meet."""
    image = bordered(picture(resolution)).astype(np.float64)
    along = np.concatenate([rng.uniform(-1, 1, 500), [-1 + 1e-7, 1 - 1e-7]])
    for edge in (-1.0, 1.0):
        one, other = np.stack([np.full_like(along, edge), along], 1), np.stack([np.full_like(along, edge), -along], 1)
        assert np.abs(bilinear(image, one) - bilinear(image, other)).max() < 1e-6
        assert np.abs(bilinear(image, one[:, ::-1]) - bilinear(image, other[:, ::-1])).max() < 1e-6
    corners = bilinear(image, np.array([[-1.0, -1], [1, -1], [-1, 1], [1, 1]]))
    assert np.ptp(corners, axis=0).max() < 1e-6


def test_a_lookup_converges_to_the_function(rng):
    """With the square of the resolution in the mean, and linearly where the map is folded."""
    d = np.concatenate([unit_vectors(rng, 4000), AXES])
    p = to_numpy(square_from_direction(vector(d))).T
    errors = [np.abs(bilinear(bordered(picture(r)).astype(np.float64), p) - smooth(d)) for r in (32, 64, 128)]
    for coarse, fine in pairwise(errors):
        assert fine.mean() < 0.28 * coarse.mean()
        assert fine.max() < 0.55 * coarse.max()
    assert errors[-1].max() < 0.01

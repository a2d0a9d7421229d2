"""The cell around a point of an image."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.bilinear import BilinearCell

SIDE = 8


def interpolated(image, cell):
    """Value of a row-major image at the cells, by the four texels' products of weights."""
    texels, stride = mi.Float(image.ravel().astype(np.float32)), image.shape[1]
    corner = cell.corner(stride)
    total = mi.Float(0)
    for down, row in enumerate((1 - cell.downward, cell.downward)):
        for right, column in enumerate((1 - cell.rightward, cell.rightward)):
            total += row * column * dr.gather(mi.Float, texels, corner + (down * stride + right))
    return np.array(total)


def test_a_linear_image_comes_back_exactly(rng):
    rows, columns = np.mgrid[0:SIDE, 0:SIDE]
    row, column = rng.uniform(0, SIDE - 1.001, (2, 100)).astype(np.float32)
    got = interpolated(2.0 * columns - 3.0 * rows + 1, BilinearCell.at(mi.Float(column), mi.Float(row)))
    assert got == pytest.approx(2 * column - 3 * row + 1, abs=2e-5)


def test_points_of_the_disk_lie_in_the_bordered_map(rng):
    """Texel centres are at (i + ½)/N without the border, y is up, and the rim has all four neighbours."""
    angle, radius = rng.uniform(0, 2 * np.pi, 200), np.sqrt(rng.uniform(0, 1, 200))
    radius[:50] = 1
    x, y = (radius * f(angle) for f in (np.cos, np.sin))
    cell = BilinearCell.in_sphere_map(mi.Point2f(x.astype(np.float32), y.astype(np.float32)), SIDE / 2)
    rows, columns = np.mgrid[0 : SIDE + 2, 0 : SIDE + 2] - 0.5
    for image, expected in ((2 * columns / SIDE - 1, x), (1 - 2 * rows / SIDE, y)):
        assert interpolated(image, cell) == pytest.approx(expected, abs=1e-6)
    assert np.array(cell.left).max() <= SIDE
    assert np.array(cell.top).max() <= SIDE

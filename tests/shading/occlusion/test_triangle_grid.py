"""Grids in triangles: every place lies in one small triangle, and linear functions are reproduced."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.shading.occlusion.triangle_grid import grid_corners, grid_places, small_triangle


@pytest.mark.parametrize("steps", [1, 2, 3, 7])
def test_linear_functions_are_reproduced(steps, rng):
    place = rng.dirichlet([1, 1, 1], 500)[:, 1:]
    place = np.concatenate([place, [[0, 0], [1, 0], [0, 1], [0.5, 0.5]]])
    number, inside = small_triangle(mi.Point2f(*place.T.astype(np.float32)), mi.UInt32(steps))
    number, inside = np.array(number), np.array(inside).T
    weights = np.stack([1 - inside.sum(1), *inside.T], axis=1)
    assert weights.min() > -1e-5
    found = np.einsum("nk,nkc->nc", weights, grid_places(steps)[grid_corners(steps)[number]])
    assert np.allclose(found, place, atol=1e-6)


def test_sizes():
    assert len(grid_places(4)) == 15
    assert len(grid_corners(4)) == 16
    assert sorted(set(grid_corners(4).ravel().tolist())) == list(range(15))

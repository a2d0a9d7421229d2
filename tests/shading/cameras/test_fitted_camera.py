"""Default camera: the whole object in the picture, and not much else."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.cameras.fitted_camera import fitted_camera


@pytest.mark.parametrize("size", [(64, 64), (160, 60), (60, 160)])
@pytest.mark.parametrize("direction", [(1, 0.5, 1.5), (0, 0, -1), (0, 1, 0), (-3, -1, 0.2)])
def test_the_box_fills_the_picture_but_for_a_margin(torus, direction, size):
    camera = fitted_camera(torus, direction, 35.0, width=size[0], height=size[1])
    corners = np.array(list(itertools.product(*torus.bounds.T))) - camera.position
    x, y, back = (corners @ camera.axes).T
    reach = max(
        np.abs(x / -back).max() / camera.half_width, np.abs(y / -back).max() * size[0] / size[1] / camera.half_width
    )
    assert 0.90 < reach < 1.0
    np.testing.assert_allclose(camera.forward, -np.array(direction) / np.linalg.norm(direction), atol=1e-12)


@pytest.mark.parametrize("direction", [(0, 0, 0), (np.nan, 0, 1)])
def test_what_is_no_direction_is_refused(torus, direction):
    with pytest.raises(InputError, match=r"^camera: the direction"):
        fitted_camera(torus, direction)

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.maps.view_grid import ViewGrid, seen_window
from tests.arrays import to_numpy, vector
from tests.shading.analytic import TANGENT, ball_scene, framing


def test_frames_are_rotations_whose_z_points_to_the_camera():
    camera = Camera.look_at((1, 2, 4), (0, 0, 0), fov_deg=60, width=30, height=20)
    grid = ViewGrid.over(camera, ball_scene(), 3)
    for frame in grid.frames:
        assert np.allclose(frame.T @ frame, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1)
    assert np.allclose(grid.frames[4][:, 2], -camera.forward, atol=0.05)


def test_weights_reproduce_the_place_of_a_view():
    """Bilinear weights of the nodes give back the place in the image plane, and a node has its own view alone."""
    camera = framing(16, fov_deg=60)
    grid = ViewGrid.over(camera, ball_scene(), 4)
    local = np.stack([camera.axes.T @ frame[:, 2] for frame in grid.frames])
    places = -local[:, :2] / local[:, 2:]
    rng = np.random.default_rng(5)
    wanted = rng.uniform(-0.9, 0.9, (50, 2)) * np.abs(places).max(axis=0)
    v = -np.concatenate([wanted, -np.ones((50, 1))], axis=1) @ camera.axes.T
    around = grid.around(vector(v / np.linalg.norm(v, axis=1, keepdims=True)))
    index, weight = (np.stack([to_numpy(pair[k]) for pair in around]) for k in range(2))
    assert np.allclose(weight.sum(axis=0), 1, atol=1e-6)
    assert np.allclose((weight[..., None] * places[index.astype(int)]).sum(axis=0), wanted, atol=1e-4)


def test_the_bounding_box_narrows_the_grid():
    camera = framing(16, fov_deg=90)
    low, high = seen_window(camera, ball_scene())
    assert np.allclose(high, 1 / 4, atol=1e-6)  # the near face of the box, at depth 4
    assert np.allclose(low, -high)
    inside = Camera.look_at((0, 0, 0.5), (0, 0, 0), fov_deg=90, width=16, height=8)
    assert np.allclose(seen_window(inside, ball_scene()), [[-1, -0.5], [1, 0.5]])


@pytest.mark.parametrize(("fov", "side"), [(4, 2), (40, 5), (120, 9)])
def test_the_field_of_view_chooses_the_grid(fov, side):
    scene = ball_scene(1.0)
    camera = Camera.look_at((0, 0, 1.2), (0, 0, 0), fov_deg=fov, width=8, height=8)
    assert int(ViewGrid.over(camera, scene).columns[0]) == side
    assert TANGENT > 0


def test_directions_beyond_the_grid_take_its_edge():
    grid = ViewGrid.over(framing(16), ball_scene(), 3)
    around = grid.around(mi.Vector3f(0.9, 0.1, 0.42))
    index = np.stack([to_numpy(pair[0]) for pair in around])
    weight = np.stack([to_numpy(pair[1]) for pair in around])
    assert index.min() >= 0
    assert index.max() < 9
    assert weight.min() >= 0
    assert np.isfinite(dr.sum(around[0][1])[0])

"""COLMAP's text files."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.maps.colmap import colmap_cameras
from rsibr.errors import InputError


def write(folder, model="PINHOLE 320 240 300 310 150 130", second=""):
    true = Pinhole.looking((3, 1, 2), (0, 0, 0), fov_deg=40, width=320, height=240)
    x, y, z, w = Rotation.from_matrix(true.axes.T).as_quat()
    shift = " ".join(map(repr, (-true.axes.T @ true.position).tolist()))
    (folder / "cameras.txt").write_text(f"# Camera list\n7 {model}\n")
    (folder / "images.txt").write_text(f"# Image list\n1 {w} {x} {y} {z} {shift} 7 a view.png\n{second}\n")
    return true


@pytest.mark.parametrize("points", ["", "12.5 13.5 -1 20 30 5"])
def test_a_camera_is_read_with_its_pose_from_the_world_to_it(tmp_path, points):
    true = write(tmp_path, second=points)
    found = colmap_cameras(tmp_path)["a view.png"]
    assert np.allclose(found.position, true.position)
    assert np.allclose(found.axes, true.axes)
    assert found.focal.tolist() == [300, 310]
    assert found.principal.tolist() == [150, 130]


def test_one_focal_length_is_that_of_both_axes(tmp_path):
    write(tmp_path, "SIMPLE_PINHOLE 320 240 300 150 130")
    assert colmap_cameras(tmp_path)["a view.png"].focal.tolist() == [300, 300]


@pytest.mark.parametrize(
    ("model", "what"),
    [
        ("OPENCV 320 240 300 310 150 130 0.1 0 0 0", "distortion"),
        ("PINHOLE 320 240 300", "parameters"),
        ("PINHOLE x 240", "no line"),
    ],
)
def test_distortion_and_broken_lines_are_refused_with_the_remedy(tmp_path, model, what):
    write(tmp_path, model)
    with pytest.raises(InputError, match=what) as caught:
        colmap_cameras(tmp_path)
    assert "undistort" in caught.value.fix


def test_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        colmap_cameras(tmp_path / "none")

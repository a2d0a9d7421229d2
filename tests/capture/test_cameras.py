"""Cameras and conventions of poses, against OpenCV and by hand."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from rsibr.capture.cameras.conventions import pose_of
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.errors import InputError


@pytest.fixture
def camera(rng):
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    axes *= np.sign(np.linalg.det(axes))
    return Pinhole(640, 480, np.array([700.0, 710.0]), np.array([330.0, 228.0]), np.array([0.3, -1.0, 2.0]), axes)


def test_places_are_those_of_opencv(camera, rng):
    """OpenCV counts from the middle of the first pixel."""
    points = camera.position + (rng.uniform(-1, 1, (20, 3)) + np.array([0, 0, 4])) @ camera.axes.T
    matrix = np.array([[700.0, 0, 330.0 - 0.5], [0, 710.0, 228.0 - 0.5], [0, 0, 1]])
    rotation, _ = cv2.Rodrigues(camera.axes.T)
    expected, _ = cv2.projectPoints(points, rotation, -camera.axes.T @ camera.position, matrix, None)
    assert np.abs(camera.project(points) - (expected[:, 0] + 0.5)).max() < 1e-9


def test_a_direction_is_seen_where_it_is_projected(camera, rng):
    places = rng.uniform(0, 480, (50, 2))
    points = camera.position + 7.0 * camera.directions(places)
    assert np.abs(camera.project(points) - places).max() < 1e-9
    assert np.isnan(camera.project(camera.position - camera.axes[:, 2])).all()


def test_conventions_describe_one_camera(camera):
    to_world, world_to = np.eye(4), np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = camera.axes, camera.position
    world_to[:3, :3], world_to[:3, 3] = camera.axes.T, -camera.axes.T @ camera.position
    opengl = to_world @ np.diag([1.0, -1.0, -1.0, 1.0])
    for matrix, name in ((to_world, "opencv"), (opengl, "opengl"), (world_to, "colmap")):
        position, axes = pose_of(matrix, name)
        assert np.allclose(position, camera.position)
        assert np.allclose(axes, camera.axes)


def test_wrong_poses_are_one_clear_line(camera):
    with pytest.raises(InputError, match="unknown convention 'openGL' of poses"):
        pose_of(np.eye(4), "openGL")
    with pytest.raises(InputError, match="shape"):
        pose_of(np.eye(3), "opencv")
    for axes in (2 * np.eye(3), np.diag([1.0, 1.0, -1.0])):
        with pytest.raises(InputError, match="no rotation"):
            Pinhole(4, 4, np.ones(2), np.zeros(2), np.zeros(3), axes)

"""Pinhole camera: against Mitsuba's own sensors, ray by ray."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera


def _sensor(**more):
    film = {"type": "hdrfilm", "width": 160, "height": 90} | more.pop("film", {})
    to_world = mi.ScalarTransform4f().look_at([3, 1, 4], [0, 0.2, -0.5], [0.1, 1, 0])
    if more.pop("mirrored", False):
        to_world = to_world @ mi.ScalarTransform4f().scale([-1, 1, 1])
    return mi.load_dict({"type": "perspective", "fov": 47.0, "to_world": to_world, "film": film} | more)


def _rays(camera: Camera, seed: int = 1):
    """Rays at random places of the picture, ours and those places in units of the picture."""
    place = np.random.default_rng(seed).random((2, 200)).astype(np.float32)
    pixels = mi.Point2f(*(place * [[camera.width], [camera.height]]).astype(np.float32))
    return camera.on_device().ray(pixels), mi.Point2f(*place)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"fov_axis": "y"},
        {"fov_axis": "diagonal"},
        {"fov_axis": "smaller"},
        {"principal_point_offset_x": 0.13, "principal_point_offset_y": -0.07},
        {"film": {"crop_offset_x": 20, "crop_offset_y": 31, "crop_width": 64, "crop_height": 40}},
        {
            "principal_point_offset_x": -0.2,
            "film": {"crop_offset_x": 3, "crop_offset_y": 5, "crop_width": 50, "crop_height": 80},
        },
        {"mirrored": True},
        {"film": {"width": 50, "height": 120}},
    ],
)
def test_rays_are_those_of_mitsubas_sensor(more):
    sensor = _sensor(**more)
    camera = Camera.of_sensor(sensor)
    ours, place = _rays(camera)
    theirs, _ = sensor.sample_ray(0.0, 0.5, place, mi.Point2f(0.5))
    np.testing.assert_allclose(np.array(ours.d), np.array(theirs.d), atol=2e-6)
    along = np.cross(np.array(theirs.o).T - camera.position, np.array(theirs.d).T)  # theirs start at the near plane
    assert np.abs(along).max() < 1e-5
    assert (camera.width, camera.height) == tuple(sensor.film().crop_size())


def test_a_thin_lens_is_taken_as_a_pinhole():
    lens = Camera.of_sensor(_sensor(type="thinlens", aperture_radius=0.1, focus_distance=3.0))
    pinhole = Camera.of_sensor(_sensor())
    np.testing.assert_allclose(lens.axes, pinhole.axes)
    assert lens.fov_deg == pytest.approx(pinhole.fov_deg)


def test_other_sensors_are_refused_in_one_line():
    with pytest.raises(InputError, match=r"sensor of the class Ortho.*Use a perspective"):
        Camera.of_sensor(mi.load_dict({"type": "orthographic"}))


def test_look_at_has_the_rays_of_mitsubas_look_at():
    camera = Camera.look_at((3, 1, 4), (0, 0.2, -0.5), (0.1, 1, 0), fov_deg=47.0, width=160, height=90)
    of_sensor = Camera.of_sensor(_sensor())
    np.testing.assert_allclose(camera.axes, of_sensor.axes, atol=1e-6)
    np.testing.assert_allclose(np.array(_rays(camera)[0].d), np.array(_rays(of_sensor)[0].d), atol=2e-6)


@pytest.mark.parametrize("up", [(0, 1, 0), (0, -2, 0)])
def test_an_up_along_the_view_is_replaced(up):
    axes = Camera.look_at((0, 5, 0), (0, 0, 0), up).axes
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


@pytest.mark.parametrize(
    ("position", "target", "fov"),
    [
        ((0, 0, 0), (0, 0, 0), 40),
        ((0, 0, np.nan), (0, 0, 0), 40),
        ((0, 0, 1), (0, 0, 0), 180),
        ((0, 0, 1), (0,) * 3, 0),
    ],
)
def test_impossible_cameras_are_refused(position, target, fov):
    with pytest.raises(InputError, match=r"^camera: "):
        Camera.look_at(position, target, fov_deg=fov)


def test_resized_keeps_the_horizontal_field_of_view():
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), fov_deg=60, width=10, height=10).resized(40, 20)
    left = np.array(camera.on_device().ray(mi.Point2f(0, 10)).d).ravel()
    assert np.degrees(np.arccos(-left[2])) == pytest.approx(30, abs=1e-4)


def test_pixels_are_numbered_row_by_row_from_the_top():
    rays = Camera.look_at((0, 0, 5), (0, 0, 0), width=4, height=2).on_device()
    centres = np.array(rays.centre(dr.arange(mi.UInt32, 8))).T
    assert centres[[0, 3, 4]].tolist() == [[0.5, 0.5], [3.5, 0.5], [0.5, 1.5]]
    assert rays.ray(mi.Point2f(2, 0.5)).d.y[0] > 0

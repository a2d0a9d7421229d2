"""Zones of shapes whose edges, curves and flats are known."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr.shading.cameras.camera import Camera
from rsibr.validation.objects.zones import ZONES, turns, zones_of
from tests.validation.doubles import GREY_SKY
from tests.validation.objects.doubles import LAMBERT, mesh, square, truths_of


def layers_of(shapes, camera):
    return truths_of(shapes, camera, LAMBERT, GREY_SKY, rays=16).primary.layers


def zones(shapes, camera):
    layers = layers_of(shapes, camera)
    found = zones_of(layers, camera)
    assert tuple(found) == ZONES
    np.testing.assert_array_equal(sum(inside.astype(int) for inside in found.values()), layers.alpha > 0)
    return found, layers


def test_a_cube_is_flat_but_for_its_edges():
    box = trimesh.creation.box((2, 2, 2))
    shapes = {"box": mesh("box", box.vertices, box.faces)}
    camera = Camera.look_at((3, 4, 6), (0, 0, 0), width=64, height=64)
    found, layers = zones(shapes, camera)
    assert not found["curved"].any()
    assert found["flat"].sum() > 3 * found["silhouette"].sum()
    assert (found["silhouette"] & (layers.alpha == 1)).sum() > 40  # the three inner edges
    corner = camera.axes.T @ (np.ones(3) - camera.position)  # where all three meet
    scale = 32 / (camera.half_width * -corner[2])
    column, row = int(32 + corner[0] * scale), int(32 - corner[1] * scale)
    assert found["silhouette"][row, column]


def test_a_sphere_is_curved_but_for_its_rim():
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=64, height=64)
    found, layers = zones({"sphere": mi.load_dict({"type": "sphere"})}, camera)
    assert not found["flat"].any()
    np.testing.assert_array_equal(found["silhouette"], (layers.alpha > 0) & (layers.alpha < 1))


def test_the_turn_of_a_sphere_s_normal_is_the_inverse_of_its_radius_in_pixels():
    camera = Camera.look_at((0, 0, 100), (0, 0, 0), fov_deg=1.4, width=65, height=65)
    layers = layers_of({"sphere": mi.load_dict({"type": "sphere"})}, camera)
    radius = 65 / (2 * camera.half_width * 99)  # at the front of the sphere
    assert turns(layers, layers.alpha > 0)[32, 32] == pytest.approx(1 / radius, rel=1e-3)


def test_a_small_turn_is_flat_and_a_larger_one_curved():
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), fov_deg=3, width=48, height=48)  # 0.004 rad a pixel in the middle
    found, _ = zones({"sphere": mi.load_dict({"type": "sphere"})}, camera)
    assert found["flat"].all()
    found, _ = zones({"sphere": mi.load_dict({"type": "sphere"})}, camera.resized(24, 24))
    assert found["curved"].all()


def test_a_surface_before_another_of_the_same_direction_has_a_silhouette():
    shapes = {
        "front": square("front", (-0.5, -0.5, 1), (1, 0, 0), (0, 1, 0)),
        "back": square("back", (-5, -5, -1), (10, 0, 0), (0, 10, 0)),
    }
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), width=64, height=64)
    found, layers = zones(shapes, camera)
    assert (layers.alpha == 1).all()
    step = np.abs(np.diff(layers.depth, axis=1)) > 1
    across = found["silhouette"][:, :-1] & found["silhouette"][:, 1:]
    assert across[step].all()
    assert not found["silhouette"][:, :12].any()
    assert found["flat"].sum() > 0.8 * layers.alpha.size


def test_a_slanted_plane_has_no_silhouette_however_steep():
    shapes = {"floor": square("floor", (-500, 0, 500), (1000, 0, 0), (0, 0, -1000))}
    camera = Camera.look_at((0, 1, 0), (0, 0.8, -1), fov_deg=20, width=48, height=24)
    found, layers = zones(shapes, camera)
    steep = layers.alpha == 1
    assert layers.depth[steep].max() > 1.5 * layers.depth[steep].min()
    assert not found["silhouette"][steep].any()

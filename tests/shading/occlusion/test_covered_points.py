"""Points under another surface are found, and take the values of the open ones around them."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.shading.occlusion.covered_points import covered, from_neighbours
from rsibr.shading.occlusion.surface_points import SurfacePoints

SIDE = 9


def sheet(height, half, side, up=1.0):
    """A square mesh of side × side vertices at a height, from −half to half in x and z, facing up or down."""
    x, z = np.meshgrid(np.linspace(-half, half, side), np.linspace(-half, half, side), indexing="ij")
    positions = np.stack([x, np.full_like(x, height), z], axis=-1).reshape(-1, 3)
    cell = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate(
        [np.stack([cell, cell + 1, cell + side], 1), np.stack([cell + 1, cell + side + 1, cell + side], 1)]
    )
    mesh = mi.Mesh("sheet", len(positions), len(faces), has_vertex_normals=True)
    values = mi.traverse(mesh)
    values["vertex_positions"] = mi.Float(positions.ravel().astype(np.float32))
    values["vertex_normals"] = mi.Float(np.tile([0, up, 0], len(positions)).astype(np.float32))
    values["faces"] = mi.UInt32(faces.ravel().astype(np.uint32))
    values.update()
    return mesh


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_what_lies_under_a_plate_is_covered(up):
    """The nine vertices under a plate that is as wide as four cells; whichever side the plate turns to them."""
    floor, plate = sheet(0, 1, SIDE), sheet(0.01, 0.52, 2, up)
    scene = backend.load({"type": "scene", "floor": floor, "plate": plate})
    points = SurfacePoints.of({"floor": floor}, ["floor"], 20)  # vertices alone
    found = covered(scene, points, lift=1.5e-4)
    place = np.abs(points.positions[:, [0, 2]]).max(axis=1)
    assert found[place < 0.4].all()
    assert not found[place > 0.6].any()


def test_a_far_ceiling_covers_nothing():
    floor, ceiling = sheet(0, 1, SIDE), sheet(0.6, 5, 2)
    scene = backend.load({"type": "scene", "floor": floor, "ceiling": ceiling})
    points = SurfacePoints.of({"floor": floor}, ["floor"], 20)  # vertices alone
    assert not covered(scene, points, lift=5e-4).any()


def test_covered_values_come_from_the_edge_inward():
    """A strip of triangles: 0 1 2 3 4 5, of which 2, 3 and 4 are covered."""
    corners = np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5]], np.uint32)
    values = np.repeat(np.array([1.0, 2.0, 9.0, 9.0, 9.0, 4.0], np.float32)[:, None], 3, axis=1)
    hidden = np.array([False, False, True, True, True, False])
    found = from_neighbours(values, hidden, corners)[:, 0]
    assert found[[0, 1, 5]].tolist() == [1, 2, 4]
    assert found[2] == pytest.approx(np.average([1, 2], weights=[1, 2]))
    assert found[3] == pytest.approx(np.average([2, 4], weights=[1, 1]))
    assert found[4] == pytest.approx(4)


def test_without_a_way_to_open_points_values_stay():
    corners, values = np.array([[0, 1, 2]], np.uint32), np.full((4, 3), 0.3, np.float32)
    assert from_neighbours(values, np.array([True, True, True, False]), corners) == pytest.approx(values)

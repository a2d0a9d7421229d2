"""Irradiance past objects against closed forms: form factors of disks, wells and half-spaces."""

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr.light.radiance import Light
from rsibr.shading.occlusion.gathering import Places, gathered, ratio_of, reflected
from rsibr.shading.occlusion.point_field import PointField
from rsibr.shading.occlusion.sky import Sky
from rsibr.shading.occlusion.surface_points import SurfacePoints
from rsibr.shading.scenes.object_scene import ObjectScene
from tests.shading.occlusion.objects import constant_light, mesh_of

RAYS = 1024
UP = np.array([[0, 0, 1]], np.float32)


def at(point):
    return Places.of(np.array([point], np.float32), UP, 0.0)


def plate(height, radius=1.0):
    """A disk above the origin that faces down."""
    turned = mi.ScalarTransform4f().translate([0, 0, height]).rotate([1, 0, 0], 180).scale(radius)
    return mi.load_dict({"type": "disk", "to_world": turned})


@pytest.mark.parametrize("depth", [0.5, 1.0, 3.0])
def test_at_the_bottom_of_a_well(depth):
    """Irradiance through the mouth of a well of radius 1: π sin² θ = π/(1 + depth²) of a constant sky of radiance 1."""
    wall = trimesh.creation.cylinder(1.0, depth, sections=256)
    wall.update_faces(np.abs(wall.face_normals[:, 2]) < 0.5)
    scene = ObjectScene("well", {"wall": mesh_of(wall, smooth=False)})
    found = gathered(scene.geometry, at([0, 0, -depth / 2 + 1e-4]), Sky.of(constant_light((1, 2, 3))), RAYS)
    assert np.allclose(found.open, [np.pi * np.array([1, 2, 3])], rtol=5e-3)
    assert ratio_of(found)[0] == pytest.approx(1 / (1 + depth**2), abs=0.01)
    assert found.hidden[0] == pytest.approx(1 - 1 / (1 + depth**2), abs=0.01)


@pytest.mark.parametrize("height", [0.3, 1.0, 2.0])
def test_between_two_parallel_plates(height):
    """A disk hides 1/(1 + h²) of the sky and, shining with radiance B, sends π B/(1 + h²) back."""
    scene = ObjectScene("plates", {"plate": plate(height)})
    found = gathered(scene.geometry, at([0, 0, 0]), Sky.of(constant_light()), RAYS)
    share = 1 / (1 + height**2)
    assert 1 - ratio_of(found)[0] == pytest.approx(share, abs=0.01)
    points = SurfacePoints.of(scene.shapes, ["plate"], scene.radius)
    shining = PointField.of(points, scene.shapes).holding(np.full((len(points), 3), 2.0, np.float32))
    assert reflected(scene.geometry, at([0, 0, 0]), shining, 64, found.hidden)[0] == pytest.approx(
        2 * np.pi * share, rel=0.03
    )


def test_the_ratio_is_that_of_the_light_not_of_the_sky():
    """Under a light from +x alone, half of the space behind a wall at +x is dark, and before one at −x nothing is."""
    from rsibr.geometry.projections.octahedral import texel_directions

    d = np.array(texel_directions(32), np.float64).T
    light = Light(((d[:, :1] > 0.3) * np.ones(3)).reshape(32, 32, 3).astype(np.float32))
    for side, expected in ((1, 0.0), (-1, 1.0)):
        turned = mi.ScalarTransform4f().translate([side, 0, 0]).rotate([0, 1, 0], -90 * side).scale(500)
        scene = ObjectScene("wall", {"wall": mi.load_dict({"type": "rectangle", "to_world": turned})})
        found = gathered(scene.geometry, at([0, 0, 0]), Sky.of(light), RAYS)
        assert ratio_of(found)[0] == pytest.approx(expected, abs=0.02)


def test_no_light_hides_nothing():
    scene = ObjectScene("plates", {"plate": plate(1.0)})
    found = gathered(scene.geometry, at([0, 0, 0]), Sky.of(constant_light((0, 0, 0))), 16)
    assert (ratio_of(found) == 1).all()

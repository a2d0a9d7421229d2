"""What is hidden, measured over a whole object."""

import pytest
import trimesh

from rsibr.shading.occlusion.self_visibility import self_visibility
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from tests.shading.occlusion.objects import constant_light, inputs_of, mesh_of, scene_of, torus


def measured(scene, names=("*",), **material):
    inputs = [inputs_of(constant_light(), **material) for _ in names]
    return self_visibility(scene, SurfaceTypes.assign(scene, list(names)), inputs)


def test_a_sphere_hides_nothing_from_itself():
    (found,) = measured(scene_of(ball=trimesh.creation.icosphere(4)))
    assert found.sky_hidden < 1e-3
    assert found.error_without < 1e-6


def test_the_inside_of_half_a_sphere():
    """Its inner side is a third of what is seen from all around, and its cap fills Ω/4π = ½ of the sky of a point."""
    ball = trimesh.creation.icosphere(5)
    ball.update_faces(ball.triangles_center[:, 2] < 0)
    ball.invert()
    (found,) = measured(ObjectScene("bowl", {"bowl": mesh_of(ball)}))
    assert found.sky_hidden == pytest.approx(1 / 6, rel=0.04)
    assert found.matte_hidden == pytest.approx(found.sky_hidden, abs=0.01)


def test_types_are_measured_apart():
    ring, ball = torus(), trimesh.creation.icosphere(3, radius=0.3)
    ball.apply_translation([0, 0, 30.0])
    hollow, convex = measured(scene_of(ring=ring, ball=ball), names=("ring", "ball"), matte=0.5, gloss=0.05)
    assert hollow.sky_hidden > 0.01 > convex.sky_hidden
    assert hollow.mirror_hidden > 0.005
    assert hollow.weight + convex.weight == pytest.approx(1)
    assert hollow.error_without > 1e-3 > convex.error_without
    assert hollow.bounced > 1e-3


def test_a_metal_is_told_as_one():
    assert measured(scene_of(ring=torus()), matte=0.0, gloss=0.8)[0].is_metal

"""Pictures that miss the object, or look at it from within, are said in one line."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.fitted_camera import fitted_camera
from rsibr.shading.cameras.view_check import view_notes
from rsibr.shading.pictures.picture import NormalCounts, Picture
from rsibr.shading.scenes.mesh_file import as_shape
from rsibr.shading.scenes.mesh_repair import TriangleMesh
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import first_surfaces
from tests.shading.conftest import scene_of, torus_mesh


def _picture(scene, camera):
    """Picture of what one ray a pixel meets, without radiance."""
    rays = camera.on_device()
    pixel = mi.UInt32(np.arange(camera.width * camera.height))
    seen = first_surfaces(scene.geometry, rays.ray(rays.centre(pixel)))
    hit, back = np.array(seen.hit), np.array(seen.is_back)
    shape = camera.height, camera.width
    empty = np.zeros((*shape, 3), np.float32)
    counts = NormalCounts(int(hit.sum()), 0, 0, 0, int(back.sum()))
    return Picture(empty, hit.reshape(shape).astype(np.float32), empty[..., 0], empty, counts)


def _notes(scene, camera, **more):
    return view_notes(_picture(scene, camera), scene, camera, **more)


def _looking(position, target=(0, 0, 0)):
    return Camera.look_at(position, target, width=32, height=32)


def test_an_object_seen_from_outside_gives_no_note(torus):
    assert _notes(torus, fitted_camera(torus, width=32, height=32)) == ()


@pytest.mark.parametrize(
    ("position", "target", "reason"),
    [
        ((0, 0, 9), (0, 0, 20), "it is behind the camera"),
        ((0, 0, 9), (9, 0, 0), r"it lies out of view, in the box \(-1.4, -0.4, -1.4\) to \(1.4, 0.4, 1.4\)"),
        ((0.7, 0.9, 1e5), (0, 0, 0), r"at a distance of 1e\+05 it is smaller than a pixel"),
    ],
)
def test_a_single_picture_without_the_object_is_refused_and_a_frame_has_a_note(torus, position, target, reason):
    camera = _looking(position, target)
    with pytest.raises(InputError, match=rf"^camera: no ray meets 'torus': {reason}. Move the camera"):
        _notes(torus, camera)
    (note,) = _notes(torus, camera, is_single=False)
    assert note.startswith("nothing of 'torus' is seen")


@pytest.mark.parametrize("is_single", [True, False])
def test_a_camera_within_a_closed_surface_is_refused(torus, sphere, is_single):
    for scene, position in ((torus, (1.0, 0.05, 0)), (sphere, (0.2, 0.1, 0))):
        with pytest.raises(InputError, match=rf"^camera: it is inside '{scene.name}'. Move it out of the box"):
            _notes(scene, _looking(position, (0, 0, 2)), is_single=is_single)


def test_a_camera_in_the_hole_of_a_torus_is_outside(torus):
    assert _notes(torus, _looking((0, 0, 0), (1, 0, 0))) == ()


def test_a_surface_inside_out_is_shown_with_a_note(variant):
    mesh = torus_mesh(24, 12)
    scene = scene_of("turned", TriangleMesh(mesh.vertices, mesh.faces[:, ::-1], -mesh.normals))
    (note,) = _notes(scene, fitted_camera(scene, width=32, height=32))
    assert note == "100% of the rays meet the inner side of a surface, which is shaded like the outer one"


def test_an_open_surface_from_behind_is_shown_with_a_note(variant):
    square = TriangleMesh(
        np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    scene = ObjectScene("square", {"square": as_shape(square, "square")})
    assert _notes(scene, _looking((0, 0, 3))) == ()
    (note,) = _notes(scene, _looking((0, 0, -3)))
    assert note.startswith("100% of the rays")

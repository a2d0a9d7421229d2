"""Pictures of objects, from scene and bakes to a file."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

import rsibr
from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.camera_choice import chosen_camera
from rsibr.shading.render import with_rest
from rsibr.shading.scenes.object_scene import ObjectScene
from tests.shading.pictures.test_picture_file import picture

FURNACE = {
    "environment": {"emitter": {"type": "constant", "radiance": 0.5}},
    "material": {"preset": "matte-lambert"},
    "map": {"resolution": 8},
    "sampling": {"samples": 64},
    "effects": {"view_dependence": "on"},
}

PLAIN = {"method": "cabral1999", "occlusion": "off"}


@pytest.fixture(scope="module")
def paint(tmp_path_factory) -> Path:
    """A matte bake under a constant environment: the radiance is the same everywhere."""
    return bake(FURNACE, out=tmp_path_factory.mktemp("bakes") / "matte.rsibr").path


def two_spheres() -> ObjectScene:
    spheres = {
        name: mi.load_dict({"type": "sphere", "center": [x, 0, 0], "radius": 0.5, "bsdf": {"type": "diffuse"}})
        for name, x in (("left", -1.0), ("right", 1.0))
    }
    return ObjectScene("spheres", spheres)


def test_a_sphere_in_a_furnace_is_the_map_everywhere(paint, tmp_path):
    made = rsibr.render("sphere", paint, resolution=(24, 16), rays=4, **PLAIN, out=tmp_path / "a.exr")
    inside = made.alpha == 1
    assert inside.any()
    assert not inside.all()
    expected = rsibr.reconstruct(paint, (0, 0, 1), method="cabral1999").image[4, 4]
    np.testing.assert_allclose(made.radiance[inside], np.broadcast_to(expected, (inside.sum(), 3)), rtol=0.03)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        assert file.channels()["RGBA"].pixels.shape == (16, 24, 4)


def test_shapes_without_a_bake_are_path_traced_or_refused_by_name(paint):
    settings = {"camera": {"position": (0, 0, 6)}, "resolution": 16, "rays": 4, **PLAIN}
    made = rsibr.render(two_spheres(), {"left": paint}, **settings)
    assert any("path-traced" in note and "right" in note for note in made.notes)
    columns = made.alpha.sum(axis=0)
    np.testing.assert_allclose(columns, columns[::-1], atol=0.26)  # the right sphere is there too
    with pytest.raises(InputError, match="'right'"):
        rsibr.render(two_spheres(), {"left": paint}, strict=True, **settings)


def test_the_rest_fills_what_a_bake_leaves():
    whole = with_rest(picture(alpha=0.25, radiance=0.1), np.full((3, 5, 3), 0.2), np.full((3, 5), 0.75))
    np.testing.assert_array_equal(whole.alpha, 1)
    np.testing.assert_allclose(whole.radiance, 0.3, rtol=1e-6)
    assert whole.radiance.dtype == np.float32


def test_bakes_under_different_light_are_noted(paint, tmp_path):
    other = FURNACE | {"environment": {"emitter": {"type": "constant", "radiance": 2.0}}}
    lit = bake(other, out=tmp_path / "lit.rsibr").path
    made = rsibr.render(two_spheres(), {"left": paint, "right": lit}, resolution=8, rays=1, **PLAIN)
    assert any("different environments" in note for note in made.notes)
    scene = two_spheres()
    scene.shapes["third"] = mi.load_dict({"type": "sphere", "bsdf": {"type": "diffuse"}})
    with pytest.raises(InputError, match="different environments"):
        rsibr.render(scene, {"left": paint, "right": lit}, resolution=8, rays=1)


def test_what_a_lookup_stands_for_and_what_a_bake_loses_is_said(paint):
    coat = {
        "type": "mask",
        "opacity": 0.5,
        "n": {"type": "bumpmap", "t": {"type": "checkerboard"}, "n": {"type": "diffuse"}},
    }
    scene = ObjectScene("leaf", {"leaf": mi.load_dict({"type": "sphere", "bsdf": coat})})
    made = rsibr.render(scene, paint, resolution=8, rays=1, lookup="auto", **PLAIN)
    assert "the mask and bump map of 'leaf' are not used" in made.notes
    assert any(note.startswith("the lookup auto is pixel (") for note in made.notes)
    assert not any("auto" in note for note in rsibr.render(scene, paint, resolution=8, rays=1, **PLAIN).notes)


def test_options_of_a_lookup_follow_its_name(paint):
    settings = {"resolution": 8, "rays": 1, **PLAIN}
    rsibr.render("sphere", paint, lookup="map-normal,filter=mip", **settings)
    for lookup, said in (("map-normal,filtr=mip", "no option 'filtr'"), ("map-normal,filter=x", "unknown filter 'x'")):
        with pytest.raises(InputError, match=said):
            rsibr.render("sphere", paint, lookup=lookup, **settings)
    with pytest.raises(InputError, match="no option 'filter'"):
        rsibr.render("sphere", paint, lookup="auto,filter=mip", **settings)


def test_a_picture_of_nothing_and_one_from_inside_are_refused(paint, tmp_path):
    settings = {"resolution": 8, "rays": 1, "out": tmp_path / "a.exr", **PLAIN}
    with pytest.raises(InputError, match="no ray meets 'sphere': it is behind the camera"):
        rsibr.render("sphere", paint, camera={"position": (0, 0, 4), "target": (0, 0, 9)}, **settings)
    with pytest.raises(InputError, match="it is inside 'sphere'"):
        rsibr.render("sphere", paint, camera={"position": (0, 0, 0.5)}, **settings)
    assert not (tmp_path / "a.exr").exists()


def test_a_wrong_ending_is_told_before_the_work():
    with pytest.raises(InputError, match="jpg"):
        rsibr.render("gone.xml", "gone.rsibr", out="a.jpg")


@pytest.mark.parametrize("exposure", [65, -65, float("nan"), float("inf")])
def test_an_exposure_out_of_range(exposure):
    with pytest.raises(InputError, match="exposure"):
        rsibr.render("gone.xml", "gone.rsibr", exposure=exposure)


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        ({"positon": (0, 0, 1)}, "id you mean 'position'"),
        ({"position": (0, 0)}, "camera.position"),
        ({"position": (0, 0, float("nan"))}, "camera.position"),
        ({"position": "up"}, "camera.position"),
        ({"direction": (0, 0, 0)}, "direction"),
        ({"direction": (0, 0, 1), "up": (0, 0, 1)}, "up without position"),
        ({"direction": (0, 0, 1), "position": (0, 0, 1)}, "both"),
        ({"position": (0, 0, 4), "fov_deg": 180}, "fov_deg"),
        ({"position": (0, 0, 4), "target": (0, 0, 4)}, "its own position"),
    ],
)
def test_a_camera_that_is_none(camera, says):
    with pytest.raises(InputError, match=says):
        chosen_camera(two_spheres(), camera)


@pytest.mark.parametrize("resolution", [0, -1, 2**15, (3, 0), (1, 2, 3), (1.5, 2)])
def test_a_resolution_that_is_none(resolution):
    with pytest.raises(InputError, match="size"):
        chosen_camera(two_spheres(), None, resolution)


@pytest.mark.parametrize("size", [(20, 10), (10, 20)])
def test_a_direction_gives_a_camera_that_sees_the_whole_object(size):
    camera = chosen_camera(two_spheres(), {"direction": (0, 0, 2), "fov_deg": 50}, size)
    assert (camera.width, camera.height, camera.fov_deg) == (*size, 50)
    np.testing.assert_allclose(camera.position[:2], 0, atol=1e-6)
    np.testing.assert_allclose(camera.forward, (0, 0, -1), atol=1e-12)
    half = np.tan(np.radians(25))
    assert 1.5 < half * (camera.position[2] - 0.5) < 1.5 * 1.1


def test_the_scene_s_camera_is_taken_unless_another_is_given():
    own = Camera.look_at((0, 0, 9), (0, 0, 0), fov_deg=30, width=12, height=10)
    scene = ObjectScene("spheres", two_spheres().shapes, own)
    assert chosen_camera(scene) is not None
    np.testing.assert_array_equal(chosen_camera(scene).position, own.position)
    assert (chosen_camera(scene).width, chosen_camera(scene).height) == (12, 10)
    assert chosen_camera(scene, {"fov_deg": 50}).fov_deg == 50
    np.testing.assert_array_equal(chosen_camera(scene, {"fov_deg": 50}).position, own.position)
    assert chosen_camera(scene, None, 7).width == 7
    np.testing.assert_array_equal(chosen_camera(scene, {"position": (1, 2, 3)}).position, (1, 2, 3))

"""Scenes from XML, dictionaries and files: what is used, what is not, and hostile input in one line."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr.errors import InputError
from rsibr.resources import scenes
from rsibr.scene.trial import IN_TRIAL
from rsibr.shading.scenes.scene_file import open_scene

PLUGINS = {
    "sphere": {},
    "rectangle": {},
    "disk": {},
    "cube": {},
    "cylinder": {},
    "bsplinecurve": {"filename": "curve.txt"},
    "linearcurve": {"filename": "curve.txt"},
    "ply": {"filename": "box.ply"},
    "obj": {"filename": "box.obj"},
}

FULL = """<scene version="3.0.0">
<integrator type="path"/>
<sensor type="orthographic"/>
<sensor type="perspective"><float name="fov" value="40"/><film type="hdrfilm">
  <integer name="width" value="64"/><integer name="height" value="48"/></film></sensor>
<bsdf type="diffuse" id="mat"/>
<shape type="sphere"><ref id="mat"/><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
<shape type="sphere" id="b"><ref id="mat"/></shape>
<emitter type="constant"/><emitter type="envmap"><string name="filename" value="missing.exr"/></emitter>
</scene>"""

INSTANCES = """<scene version="3.0.0">
<shape type="shapegroup" id="g">
  <shape type="cube" id="box"><transform name="to_world"><scale x="0.3" y="0.6" z="0.2"/></transform></shape>
  <shape type="sphere"><point name="center" x="0" y="1" z="0"/><float name="radius" value="0.4"/></shape>
</shape>
<shape type="instance" id="i"><ref id="g"/><transform name="to_world">
  <rotate x="0.6" y="0.8" angle="40"/><translate x="1.5"/></transform></shape>
<shape type="instance"><ref id="g"/><transform name="to_world"><translate x="-1"/></transform></shape>
</scene>"""


def _xml(folder, text):
    path = folder / "scene.xml"
    path.write_text(text)
    return path


def _scene(*shapes):
    return f'<scene version="3.0.0">{"".join(shapes)}</scene>'


def test_the_word_sphere_is_the_unit_sphere():
    scene = open_scene("sphere")
    np.testing.assert_allclose(scene.bounds, [[-1] * 3, [1] * 3])
    assert (list(scene.shapes), scene.camera, scene.notes) == (["sphere"], None, ())


def test_shapes_and_camera_of_a_scene_are_used_and_the_rest_is_noted(tmp_path):
    scene = open_scene(_xml(tmp_path, FULL))
    assert list(scene.shapes) == ["shape-1", "b"]
    assert scene.camera is not None
    assert (scene.camera.width, scene.camera.height) == (64, 48)
    assert scene.camera.fov_deg == pytest.approx(40)
    assert scene.notes == (
        "2 emitters of the scene are not used: the light is that of the bakes",
        "1 shape glows in the scene, and does not here: the light is that of the bakes",
        "1 further sensor is not used",
    )
    assert not any(shape.is_emitter() for shape in scene.shapes.values())


def test_a_sensor_that_is_not_perspective_is_named_in_a_note(tmp_path):
    scene = open_scene(_xml(tmp_path, _scene('<sensor type="orthographic"/><shape type="sphere"/>')))
    assert scene.camera is None
    assert scene.notes == ("its sensor is not used: pictures are perspective, and it is 'orthographic'",)


def test_the_lens_of_a_sensor_is_noted():
    scene = open_scene({"type": "scene", "s": {"type": "thinlens", "aperture_radius": 0.1}, "a": {"type": "sphere"}})
    assert scene.camera is not None
    assert scene.notes == ("the lens of its sensor is taken as a pinhole: everything is in focus",)


@pytest.mark.parametrize("plugin", PLUGINS)
def test_shapes_of_mitsuba_work(tmp_path, plugin, monkeypatch):
    monkeypatch.chdir(tmp_path)
    box = trimesh.creation.box()
    box.export("box.ply")
    box.export("box.obj")
    (tmp_path / "curve.txt").write_text("".join(f"{k} 0 0 0.1\n" for k in range(5)))
    shape = {"type": plugin} | PLUGINS[plugin]
    scene = open_scene({"type": "scene", "it": shape})
    assert list(scene.shapes) == ["it"]
    strings = "".join(f'<string name="{key}" value="{value}"/>' for key, value in PLUGINS[plugin].items())
    of_xml = open_scene(_xml(tmp_path, _scene(f'<shape type="{plugin}">{strings}</shape>')))
    np.testing.assert_allclose(of_xml.bounds, scene.bounds)


def test_instances_meet_rays_where_mitsubas_do(tmp_path, rng):
    scene = open_scene(_xml(tmp_path, INSTANCES))
    assert list(scene.shapes) == ["i-box", "i-sphere", "shape-3-box", "shape-3-sphere"]
    theirs = mi.load_file(str(tmp_path / "scene.xml"))
    origin = np.concatenate([rng.uniform(-2.5, 3, (1, 500)), rng.uniform(-2, 2, (1, 500)), np.full((1, 500), 6.0)])
    ray = mi.Ray3f(mi.Point3f(*origin.astype(np.float32)), mi.Vector3f(0, 0, -1))
    expected, got = (one.ray_intersect(ray) for one in (theirs, scene.geometry))
    hit = np.array(expected.is_valid())
    assert 40 < hit.sum() < 400
    assert np.array_equal(hit, np.array(got.is_valid()))
    np.testing.assert_allclose(np.array(got.t)[hit], np.array(expected.t)[hit], rtol=1e-4)
    np.testing.assert_allclose(np.array(got.n)[:, hit], np.array(expected.n)[:, hit], atol=1e-3)


def test_an_instance_that_stretches_a_sphere_is_refused(tmp_path):
    stretched = INSTANCES.replace('<translate x="-1"/>', '<scale x="2"/>')
    with pytest.raises(InputError, match="an instance stretches or shears a sphere"):
        open_scene(_xml(tmp_path, stretched))


def test_a_dictionary_with_loaded_objects_works():
    shape, bsdf = mi.load_dict({"type": "sphere"}), mi.load_dict({"type": "diffuse"})
    scene = open_scene({"type": "scene", "ball": shape, "box": {"type": "cube", "material": bsdf}})
    assert list(scene.shapes) == ["ball", "box"]
    lamp = mi.load_dict({"type": "sphere", "e": {"type": "area"}})
    with pytest.raises(InputError, match="the shape 'lamp' was loaded with an emitter"):
        open_scene({"type": "scene", "lamp": lamp})


def test_a_single_shape_is_a_scene():
    assert list(open_scene({"type": "cube"}).shapes) == ["cube"]


def test_a_textured_shape_is_loaded_for_path_tracing():
    checkers = {"type": "diffuse", "reflectance": {"type": "checkerboard"}}
    assert list(open_scene({"type": "scene", "floor": {"type": "rectangle", "material": checkers}}).shapes) == ["floor"]


def _bomb():
    entities = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10 if k else "lol"}">' for k in range(10))
    return f'<?xml version="1.0"?><!DOCTYPE x [{entities}]><scene version="3.0.0">&e9;</scene>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<scene version="3.0.0"><shape', "is not well-formed XML (line 1, col 24)"),
        (_bomb(), "is not well-formed XML"),
        (_scene(), "no shape to shade"),
        (_scene('<shape type="foo"/>'), '"foo": Plugin "foo" not found'),
        (_scene('<shape type="ply"><string name="filename" value="x.ply"/></shape>'), "there is no file 'x.ply'"),
        (_scene('<shape type="ply"><string name="filename" value="/dev/zero"/></shape>'), "is no regular file"),
        (_scene('<shape type="ply"/>'), "filename"),
        (_scene('<shape type="sphere" id="a"/>' * 2), 'duplicate ID: "a"'),
        (
            _scene('<shape type="sphere"><bsdf type="blendbsdf"/></shape>'),
            "'blendbsdf' has 0 nested BSDFs, and takes 2",
        ),
        (_scene('<shape type="sphere"><float name="radios" value="1"/></shape>'), "radios"),
        (_scene('<shape type="sphere"><float name="radius" value="nan"/></shape>'), ""),
        (_scene('<shape type="instance"/>'), "an instance of 0 shape groups"),
        (_scene('<shape type="sphere"><ref id="nowhere"/></shape>'), "nowhere"),
        (_scene('<include filename="scene.xml"/>'), "more than 15 deep"),
        ('<bsdf version="3.0.0" type="diffuse"/>', ""),
        ("<html/>", ""),
        (_scene('<shape type="serialized"><string name="filename" value="scene.xml"/></shape>'), ""),
        (_scene('<shape type="bsplinecurve"><string name="filename" value="scene.xml"/></shape>'), ""),
    ],
)
def test_broken_scenes_give_one_line_that_names_the_file(tmp_path, text, message):
    path = _xml(tmp_path, text)
    with pytest.raises(InputError) as raised:
        open_scene(path)
    assert message in str(raised.value)
    assert "scene.xml" in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


def test_faces_of_vertices_that_do_not_exist_are_refused(tmp_path):
    (tmp_path / "bad.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"
    )
    with pytest.raises(InputError, match="'shape-1' has faces of vertices that do not exist"):
        open_scene(_xml(tmp_path, _scene('<shape type="ply"><string name="filename" value="bad.ply"/></shape>')))


@pytest.mark.parametrize(
    ("plugin", "message"),
    [
        ({"type": "scene"}, "no shape to shade"),
        ({}, "no shape to shade"),
        ({"type": "diffuse"}, "neither a scene nor a shape"),
        ({"type": "scene", "a": {"type": "nothing"}}, "not found"),
        ({"type": "scene", "a": {"type": "ply", "filename": "nowhere.ply"}}, "nowhere.ply"),
        ({"type": "scene", "a": {"type": "sphere", "m": {"type": "twosided"}}}, "has 0 nested BSDFs"),
        ({"type": "scene", "a": 5, "b": object()}, ""),
    ],
)
def test_broken_dictionaries_give_one_line(plugin, message):
    with pytest.raises(InputError) as raised:
        open_scene(plugin)
    assert message in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize("name", ["no.xml", "a.txt", "ending", ".", "x" * 5000, "a\0b.ply"])
def test_what_is_no_scene_file_is_refused(tmp_path, name):
    (tmp_path / "a.txt").write_text("x")
    (tmp_path / "ending").write_text("x")
    with pytest.raises(InputError):
        open_scene(str(tmp_path / name))


def test_a_mesh_file_is_opened_by_its_ending(tmp_path):
    trimesh.creation.box().export(tmp_path / "box.STL".lower())
    scene = open_scene(tmp_path / "box.stl")
    assert (scene.name, list(scene.shapes), scene.camera) == ("box.stl", ["box"], None)


@pytest.mark.slow
def test_a_scene_that_crashes_mitsuba_is_refused_and_others_pass_the_trial(tmp_path, monkeypatch):
    monkeypatch.delenv(IN_TRIAL)
    assert list(open_scene(_xml(tmp_path, FULL)).shapes) == ["shape-1", "b"]
    assert list(open_scene({"type": "scene", "a": {"type": "sphere"}}).shapes) == ["a"]
    monkeypatch.setattr("rsibr.shading.scenes.mitsuba_scene._TRIAL", "tests.shading.crashing_child")
    with pytest.raises(InputError, match=r"Mitsuba crashed \(SIGSEGV\) while loading it"):
        open_scene({"type": "scene", "b": {"type": "sphere"}})


def test_the_shipped_car_needs_no_trial(monkeypatch):
    monkeypatch.delenv(IN_TRIAL)
    monkeypatch.setattr("rsibr.shading.scenes.mitsuba_scene.require_survival_of", lambda *_: pytest.fail("tried"))
    assert list(open_scene(scenes() / "objects" / "car.xml").shapes) == ["body", "rubber", "metal", "glass"]

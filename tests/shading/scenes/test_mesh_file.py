"""Mesh files of all kinds: names, transforms, hostile and damaged content."""

from __future__ import annotations

import json
import os
from contextlib import suppress

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr import machine
from rsibr.errors import InputError, MachineError
from rsibr.shading.scenes.mesh_file import SUFFIXES, load_meshes
from tests.shading.conftest import torus_mesh

CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 {}\n"
)


def _loaded(path, content):
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_meshes(path)


def _vertices(shape):
    return np.array(mi.traverse(shape)["vertex_positions"]).reshape(-1, 3)


def _normals(shape):
    return np.array(mi.traverse(shape)["vertex_normals"]).reshape(-1, 3)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".stl", ".PLY"])
def test_a_torus_comes_back_from_every_format(tmp_path, suffix):
    torus = torus_mesh(48, 24)
    made = trimesh.Trimesh(torus.vertices, torus.faces, vertex_normals=torus.normals, process=False)
    path = tmp_path / f"ring{suffix}"
    kind = suffix[1:].lower()
    path.write_bytes(content if isinstance(content := made.export(file_type=kind), bytes) else content.encode())
    shapes, notes = load_meshes(path)
    (shape,) = shapes.values()
    assert notes == ()
    assert list(shapes) == ["ring"]
    p, n = _vertices(shape), _normals(shape)
    ring = p * [1, 0, 1] / np.linalg.norm(p * [1, 0, 1], axis=1, keepdims=True)
    assert len(p) == len(torus.vertices)
    np.testing.assert_allclose(np.linalg.norm(p - ring, axis=1), 0.4, atol=1e-5)
    assert ((p - ring) / 0.4 * n).sum(axis=1).min() > 0.995


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("f 1 2 3\n", ["model"]),
        ("mtllib /dev/zero\nusemtl paint\nf 1 2 3\n", ["paint"]),
        ("mtllib ../x.mtl\nusemtl paint\nf 1 2 3\nusemtl glass\nf 1 2 4\n", ["paint", "glass"]),
        ("o car\nf 1 2 3\no wheel\nf 2 3 4\n", ["car", "wheel"]),
        ("o car\nusemtl a\nf 1 2 3\no wheel\nusemtl a\nf 2 3 4\n", ["car", "wheel"]),
        ("o car\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\no wheel\nusemtl c\nf 2 3 4\n", ["car-a", "car-b", "wheel"]),
        ("o Cube.001\nf 1 2 3\n", ["Cube.001"]),
        ("f 1 2 3\nf 1/7 2/9 4/9\n", ["model"]),
        ("f -4 -3 -2 -1\n", ["model"]),
    ],
)
def test_parts_of_an_obj_have_the_names_of_objects_and_materials(tmp_path, text, names):
    shapes, _ = _loaded(tmp_path / "model.obj", CORNERS + text)
    assert list(shapes) == names
    assert [shape.id() for shape in shapes.values()] == names


def test_scene_graphs_are_applied_and_mirrored_parts_stay_outward(tmp_path):
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    scene.add_geometry(box, node_name="left", geom_name="wheel")
    mirror = np.diag([-2.0, 1, 1, 1])
    mirror[:3, 3] = 5, 0, 1
    scene.graph.update(frame_to="right", matrix=mirror, geometry="wheel")
    scene.export(tmp_path / "car.glb")
    shapes, notes = load_meshes(tmp_path / "car.glb")
    assert sorted(shapes) == ["wheel", "wheel-2"]
    assert notes == ()
    boxes = sorted([_vertices(s).min(axis=0).tolist(), _vertices(s).max(axis=0).tolist()] for s in shapes.values())
    assert boxes == [[[-0.5] * 3, [0.5] * 3], [[4, -0.5, 0.5], [6, 0.5, 1.5]]]
    for shape in shapes.values():
        outward = _vertices(shape) - _vertices(shape).mean(axis=0)
        assert ((outward * _normals(shape)).sum(axis=1) > 0).all()


@pytest.mark.parametrize("scale", [(1.0, 3.0, 0.5), (-1.0, 3.0, 0.5)])
def test_normals_follow_a_scale_that_is_not_uniform(tmp_path, scale):
    torus = torus_mesh(48, 24)
    scene = trimesh.Scene()
    stretch = np.diag([*scale, 1])
    made = trimesh.Trimesh(torus.vertices, torus.faces, vertex_normals=torus.normals, process=False)
    scene.add_geometry(made, node_name="ring", geom_name="ring", transform=stretch)
    scene.export(tmp_path / "ring.glb")
    shapes, notes = load_meshes(tmp_path / "ring.glb")
    (shape,) = shapes.values()
    assert notes == ()
    expected = torus.normals / scale
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(_normals(shape), expected, atol=1e-5)


def _gltf(uri):
    return json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 10}]})


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", "hello world\n" * 10, "no PLY file that can be read, or damaged"),
        ("a.ply", "", "no PLY file"),
        ("a.ply", PLY.format("0 1 9"), "faces of vertices that do not exist"),
        ("a.ply", PLY.format("0 1 1"), "no triangle with an area"),
        ("a.obj", "hello world\n" * 10, "no triangle with an area"),
        ("a.obj", CORNERS, "no triangle with an area"),
        ("a.obj", CORNERS + "f 1 2 9\n", "damaged"),
        ("a.obj", "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "no OBJ file that can be read, or damaged"),
        ("a.gltf", "hello", "no GLTF file that can be read, or damaged"),
        ("a.stl", "hello world\n" * 10, "no triangle with an area"),
        ("a.glb", "hello world\n" * 10, "no GLB file"),
        ("a.gltf", json.dumps({"asset": {"version": "1.0"}}), "only GLTF 2 is supported"),
        ("a.gltf", _gltf("../../etc/passwd"), "names the file '../../etc/passwd' outside its folder"),
        ("a.gltf", _gltf("/etc/passwd"), "outside its folder"),
        ("a.gltf", _gltf("https://example.com/a.bin"), "names the file 'https://example.com/a.bin': No such file"),
        ("a.gltf", _gltf("pipe"), "it is a named pipe"),
        ("a.gltf", _gltf("x" * 5000), "names the file 'xxx"),
    ],
)
def test_damaged_and_hostile_files_give_one_line(tmp_path, name, content, message):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError) as raised:
        _loaded(tmp_path / name, content)
    assert message in str(raised.value)
    assert str(raised.value).startswith(str(tmp_path / name))
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize("suffix", [".ply", ".glb", ".stl"])
def test_every_truncation_gives_one_line_or_a_mesh(tmp_path, suffix):
    content = trimesh.creation.box().export(file_type=suffix[1:])
    for length in np.linspace(0, len(content) - 1, 25).astype(int):
        shapes = {}
        with suppress(InputError):  # always one line; anything else fails
            shapes, _ = _loaded(tmp_path / f"box{suffix}", content[:length])
        assert all(np.isfinite(_vertices(shape)).all() for shape in shapes.values())


def test_points_alone_are_refused(tmp_path):
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "points.ply")
    with pytest.raises(InputError, match="no triangle with an area"):
        load_meshes(tmp_path / "points.ply")


def test_parts_without_a_surface_are_left_out_with_a_note(tmp_path):
    shapes, notes = _loaded(tmp_path / "a.obj", CORNERS + "o good\nf 1 2 3\no flat\nf 1 1 2\n")
    assert list(shapes) == ["good"]
    assert notes == ("1 part of the file without a surface: left out",)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_does_not_fit_into_the_memory_is_refused_before_it_is_read_apart(tmp_path, suffix, monkeypatch):
    monkeypatch.setattr(machine, "memory", lambda: machine.Memory(2**30, 1000))
    with pytest.raises(MachineError, match=r"a mesh file of 1\.95 KiB takes about .* and 1000 B are free"):
        _loaded(tmp_path / f"a{suffix}", b" " * 2000)


@pytest.mark.slow
def test_a_million_triangles_are_read_within_reason(tmp_path):
    torus = torus_mesh(1000, 500)
    (tmp_path / "big.ply").write_bytes(
        trimesh.Trimesh(torus.vertices, torus.faces, process=False).export(file_type="ply")
    )
    (shape,) = load_meshes(tmp_path / "big.ply")[0].values()
    assert shape.vertex_count() == 500_000
    p = _vertices(shape)
    ring = p * [1, 0, 1] / np.linalg.norm(p * [1, 0, 1], axis=1, keepdims=True)
    assert ((p - ring) / 0.4 * _normals(shape)).sum(axis=1).min() > 0.9999

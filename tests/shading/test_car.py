"""Demo car: small, closed, outward, the same from its generator, and packed into the wheel."""

from __future__ import annotations

import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rsibr.resources import scenes

PARTS = ("body", "rubber", "metal", "glass")
_ROOT = Path(__file__).parents[2]


def _part(name, folder=None):
    return trimesh.load((folder or scenes() / "objects") / f"car-{name}.ply", process=False)


def test_the_scene_has_its_parts_and_a_camera_that_sees_them(car):
    assert list(car.shapes) == list(PARTS)
    assert car.notes == ()
    corners = np.stack(np.meshgrid(*car.bounds.T), -1).reshape(-1, 3) - car.camera.position
    x, y, back = (corners @ car.camera.axes).T
    half = car.camera.half_width
    assert (np.abs(x / back) < half).all()
    assert (np.abs(y / back) < half * car.camera.height / car.camera.width).all()


def test_all_files_together_are_small():
    assert sum(file.stat().st_size for file in (scenes() / "objects").iterdir()) < 1.5e6


def test_the_body_is_closed_and_faces_outward():
    body = _part("body")
    body.merge_vertices()
    assert body.is_watertight
    assert body.is_winding_consistent
    assert 5 < body.volume < 6  # m³, of a car 4.4 m long


@pytest.mark.parametrize("name", PARTS)
def test_normals_are_unit_vectors_on_the_outer_side(name):
    part = _part(name)
    n = part._cache["vertex_normals"]
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1, atol=1e-4)
    agree = (part.face_normals[:, None] * n[part.faces]).sum(axis=-1).mean(axis=1) > 0
    assert agree.mean() > 0.97  # the rest lies within the arches


@pytest.mark.slow
def test_the_generator_writes_the_shipped_files(tmp_path):
    runpy.run_path(str(scenes() / "objects" / "make_car.py"))["main"](tmp_path)
    for name in PARTS:
        ours, shipped = _part(name, tmp_path), _part(name)
        np.testing.assert_array_equal(ours.faces, shipped.faces)
        np.testing.assert_allclose(ours.vertices, shipped.vertices, atol=1e-5)


def test_scenes_are_packed_into_the_wheel():
    packed = tomllib.loads((_ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert packed["force-include"]["scenes"] == "rsibr/_data/scenes"

"""`capture maps` in the closed loop: photographs by `capture synth`, and what a user can do wrong."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import rsibr
from rsibr.capture.photographs.photograph import opencv
from rsibr.capture.synth import Shooting, capture_synth
from rsibr.capture.synthetic.scenes import named_ball
from rsibr.cli.app import app
from rsibr.errors import InputError
from tests.capture.maps.mirror_maps import uneven
from tests.capture.skies import courtyard


@pytest.fixture(scope="module")
def shots(tmp_path_factory):
    """Six views of a small ball."""
    folder = tmp_path_factory.mktemp("shots")
    shooting = Shooting(distance=20, pixels=48, shots=2, stops=3, bits=16, samples=4)
    return capture_synth(courtyard(), named_ball("metallic-silver"), uneven(6), folder, shooting)


def changed(shots, name, **values):
    """Another document beside the photographs."""
    document = {**json.loads(shots.read_text()), **values}
    file = shots.with_name(f"{name}.json")
    file.write_text(json.dumps({key: value for key, value in document.items() if value is not None}))
    return file


def photographs(shots, without=(), **values):
    found = json.loads(shots.read_text())["photographs"]
    return [{**{key: part for key, part in one.items() if key not in without}, **values} for one in found]


def directions(bake):
    return np.array(bake.manifest.directions)


def test_views_are_from_the_sphere_to_the_cameras(shots, tmp_path):
    bake = rsibr.capture_maps(shots, tmp_path / "x.rsibr", resolution=16)
    assert np.allclose(directions(bake), uneven(6), atol=1e-6)
    assert bake.manifest.capture.distances == pytest.approx([20] * 6)
    assert bake.manifest.capture.variance == "photographs"
    assert bake.map(0).variance.max() > 0


def test_the_outline_places_the_camera_where_the_sphere_is_not_stated(shots, tmp_path):
    """Whatever the scale of the poses: with COLMAP nobody knows it."""
    bake = rsibr.capture_maps(changed(shots, "outline", sphere=None), tmp_path / "x.rsibr", resolution=16)
    away = np.degrees(np.arccos(np.clip((directions(bake) * uneven(6)).sum(axis=1), -1, 1)))
    assert away.max() < 0.1
    assert bake.manifest.capture.distances == pytest.approx([20] * 6, rel=0.02)


def test_all_conventions_and_colmap_give_the_same_bake(shots, tmp_path):
    known = photographs(shots)
    poses = [np.array(one["pose"]) for one in known]
    opengl = [{**one, "pose": (pose * [1, -1, -1, 1]).tolist()} for one, pose in zip(known, poses, strict=True)]
    world = [{**one, "pose": np.linalg.inv(pose).tolist()} for one, pose in zip(known, poses, strict=True)]
    files = [
        changed(shots, "opengl", convention="opengl", photographs=opengl),
        changed(shots, "world", convention="colmap", photographs=world),
        changed(shots, "text", convention=None, colmap="sparse", photographs=_as_colmap(shots, known, poses)),
    ]
    expected = rsibr.capture_maps(shots, tmp_path / "0.rsibr", resolution=16).map(2).radiance
    for index, file in enumerate(files, 1):
        found = rsibr.capture_maps(file, tmp_path / f"{index}.rsibr", resolution=16).map(2).radiance
        assert np.allclose(found, expected, rtol=1e-3, atol=1e-4)


def _as_colmap(shots, known, poses):
    folder = shots.parent / "sparse"
    folder.mkdir(exist_ok=True)
    fx, fy, cx, cy = known[0]["intrinsics"]
    (folder / "cameras.txt").write_text(f"1 PINHOLE 48 48 {fx} {fy} {cx} {cy}\n")
    lines = []
    for number, (one, pose) in enumerate(zip(known, poses, strict=True)):
        world = np.linalg.inv(pose)
        x, y, z, w = Rotation.from_matrix(world[:3, :3]).as_quat()
        a, b, c = world[:3, 3]
        lines += [f"{number} {w} {x} {y} {z} {a} {b} {c} 1 {one['shots'][0]['file']}", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    return [{"image": one["shots"][0]["file"], "shots": one["shots"]} for one in known]


@pytest.mark.parametrize(
    ("name", "values", "what"),
    [
        ("no_convention", {"convention": None}, "no convention"),
        ("unknown", {"convention": "unity"}, "unknown convention"),
        ("key", {"spheres": 1}, "spheres"),
        ("none", {"photographs": []}, "no photographs"),
        ("inside", {"sphere": {"centre": [0, 0, 0], "radius": 50}}, "inside the sphere"),
        ("schema", {"schema": 2}, "schema"),
    ],
)
def test_a_wrong_document_is_refused_in_one_line(shots, tmp_path, name, values, what):
    with pytest.raises(InputError) as caught:
        rsibr.capture_maps(changed(shots, name, **values), tmp_path / "x.rsibr")
    assert what in str(caught.value)
    assert not (tmp_path / "x.rsibr").exists()


@pytest.mark.parametrize(
    ("name", "without", "what"),
    [
        ("pose", ("pose",), "too little"),
        ("shots", ("shots",), "neither a file nor shots"),
        ("mask", ("mask",), "where"),
    ],
)
def test_a_photograph_without_what_is_needed_is_refused(shots, tmp_path, name, without, what):
    file = changed(shots, f"without_{name}", sphere=None, photographs=photographs(shots, without))
    with pytest.raises(InputError, match=what):
        rsibr.capture_maps(file, tmp_path / "x.rsibr")


def test_a_pose_that_puts_the_sphere_off_its_outline_is_said(shots, tmp_path):
    moved = photographs(shots)
    pose = np.array(moved[1]["pose"])
    pose[:3, :3] = Rotation.from_euler("y", 2, degrees=True).as_matrix() @ pose[:3, :3]
    moved[1]["pose"] = pose.tolist()
    bake = rsibr.capture_maps(changed(shots, "moved", photographs=moved), tmp_path / "x.rsibr", resolution=16)
    assert any("view_01" in one and "from its outline" in one for one in bake.manifest.capture.notes)


def test_the_command_says_what_is_covered_and_which_methods_serve(shots, tmp_path):
    out = tmp_path / "x.rsibr"
    result = CliRunner().invoke(app, ["capture", "maps", str(shots), "--out", str(out), "--resolution", "16", "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout.splitlines()[-1])
    assert found["methods"] == ["nearest", "blend", "cabral1999", "cabral1999-mesh"]
    assert 0 <= found["covered"] <= 1
    assert found["notes"]


@pytest.mark.slow
def test_from_photographs_to_the_one_that_was_turned(tmp_path):
    """12 brackets of 16 bits; then one view's files upside down: check names it, and accuses none before."""
    shooting = Shooting(distance=20, pixels=240, shots=4, bits=16, samples=16)
    path = capture_synth(courtyard(), named_ball("clearcoat-red"), uneven(12), tmp_path / "shots", shooting)
    bake = rsibr.capture_maps(path, tmp_path / "paint.rsibr", resolution=96)
    assert rsibr.check(bake).capture.judgement.suspects == ()
    cv2 = opencv()

    for shot in path.parent.glob("view_05_shot_*.png"):
        picture = cv2.imread(str(shot), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(shot), np.ascontiguousarray(picture[::-1, ::-1]))
    wrong = rsibr.capture_maps(path, tmp_path / "wrong.rsibr", resolution=96)
    suspects = rsibr.check(wrong).capture.judgement.suspects
    assert [(one.view, one.fault) for one in suspects] == [(5, "orientation")]

"""`rsibr render`: what it writes and says, and a line for whatever is wrong."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from matplotlib.image import imread

SMALL = ["--resolution", "12x8", "--rays", "1", "--occlusion", "off", "--method", "cabral1999"]


def test_a_picture_with_layers(shell, baked, tmp_path):
    out = tmp_path / "a.exr"
    ended = shell("render", "sphere", "--bake", baked, "--out", out, "--camera", "-3,1,4", *SMALL, "--json")
    assert ended.code == 0, ended.stderr
    assert ended.json["resolution"] == [12, 8]
    assert 0 < ended.json["covered"] < 1
    with OpenEXR.File(str(out), separate_channels=True) as file:
        assert file.channels()["depth.Z"].pixels.shape == (8, 12)
        depth = file.channels()["depth.Z"].pixels
    assert np.isfinite(depth).any()
    np.testing.assert_allclose(depth[np.isfinite(depth)].min(), np.sqrt(26) - 1, atol=0.3)


def test_a_missing_folder_is_made_once_there_is_something_to_put_there(shell, baked, tmp_path):
    out = tmp_path / "new" / "folder" / "a.exr"
    shell.refuses("render", "spher", "--bake", baked, "--out", out, *SMALL)
    assert not (tmp_path / "new").exists()
    assert shell("render", "sphere", "--bake", baked, "--out", out, *SMALL).code == 0
    assert out.is_file()


def test_a_turntable_of_numbered_files(shell, baked, tmp_path):
    command = ["render", "sphere", "--bake", f"sphere={baked}", "--out", tmp_path / "t.png", "--frames", "2", *SMALL]
    ended = shell(*command)
    assert ended.code == 0, ended.stderr
    assert "2 frames" in ended.stdout
    assert imread(tmp_path / "t_0002.png").shape == (8, 12, 4)
    again = shell(*command, "--json").json
    assert (again["kept"], again["already_complete"]) == (2, True)
    assert "t_0002.png: already complete, 2 frames" in shell(*command).stdout


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--out", "a.jpg"], "'.jpg'"),
        (["--out", "a"], "no ending"),
        (["--out", "a.mp4"], "--frames"),
        (["--camera", "1,2"], "--camera"),
        (["--camera", "-1,2,nan"], "--camera"),
        (["--camera", "1,2,3", "--from", "1,2,3"], "--from"),
        (["--from", "0,0,0"], "--from"),
        (["--from", "up"], "--from"),
        (["--fov", "180"], "--fov"),
        (["--fov", "nan"], "--fov"),
        (["--resolution", "0"], "--resolution"),
        (["--resolution", "2x3x4"], "--resolution"),
        (["--rays", "0"], "--rays"),
        (["--occlusion", "maybe"], "--occlusion"),
        (["--exposure", "99"], "--exposure"),
        (["--environment-distance", "0"], "--environment-distance"),
        (["--environment-distance=nan"], "--environment-distance"),
        (["--frames", "0"], "--frames"),
        (["--path", "p.json"], "--frames"),
        (["--fresh"], "--frames"),
        (["--frames", "2", "--path", "gone.json"], "gone.json"),
        (["--bake", "=x"], "no bake"),
        (["--bake", "x", "--bake", "y"], "two bakes"),
    ],
)
def test_wrong_arguments(shell, tmp_path, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    bake = [] if "--bake" in arguments else ["--bake", "gone.rsibr"]
    out = [] if "--out" in arguments else ["--out", "a.exr"]
    shell.refuses("render", "sphere", *bake, *out, *arguments, "--json", says=says)
    assert list(tmp_path.iterdir()) == []


def test_near_surroundings_are_noted(shell, baked, tmp_path):
    render = ["render", "sphere", "--bake", baked, "--out", tmp_path / "a.png", *SMALL]
    assert "near_field" not in shell(*render).stderr
    assert "near_field" not in shell(*render, "--environment-distance", "1000").stderr
    near = shell(*render, "--environment-distance", "5").stderr
    assert "note: near_field: left out, though it matters here: the surroundings are near" in near


def test_wrong_inputs(shell, baked, tmp_path):
    out = ["--out", tmp_path / "a.exr"]
    shell.refuses("render", "sphere", "--bake", tmp_path / "gone.rsibr", *out, says="gone.rsibr")
    shell.refuses("render", tmp_path / "gone.xml", "--bake", baked, *out, says="gone.xml")
    shell.refuses("render", "sphere", "--bake", f"spher={baked}", *out, says="id you mean 'sphere'")
    shell.refuses("render", "sphere", "--bake", baked, *out, "--method", "cabral", says="cabral1999")
    shell.refuses("render", "sphere", "--bake", baked, *out, "--lookup", "pixl", says="pixel")
    assert not (tmp_path / "a.exr").exists()


def test_a_map_as_png(shell, baked, tmp_path):
    shell.refuses("reconstruct", baked, "--view", "1,2,3", "--out", tmp_path / "x.tif", says="'.tif'")
    assert shell("reconstruct", baked, "--view", "1,2,3", "--out", tmp_path / "x.png").code == 0
    rgba = imread(tmp_path / "x.png")
    assert rgba.shape == (8, 8, 4)
    assert rgba[0, 0, 3] < 1 == rgba[4, 4, 3]
    assert rgba[4, 4, 0] == pytest.approx(0.906, abs=0.03)  # linear 0.8: a matte sphere in a furnace has one colour

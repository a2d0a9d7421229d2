"""Turntables and camera paths: cameras, names, exposure, and going on after a kill."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rsibr
from rsibr.errors import InputError, MachineError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.camera_path import Key, along_path, read_path, turntable
from rsibr.shading.pictures import sequence
from rsibr.shading.pictures.sequence import FrameFiles
from rsibr.shading.render import RenderJob
from tests.shading.test_render import PLAIN, paint, two_spheres  # noqa: F401

SETTINGS = {"resolution": 8, "rays": 1, **PLAIN}


def test_a_turntable_keeps_distance_and_height_and_looks_at_the_axis():
    camera, centre = Camera.look_at((3, 1, 4), (1, 0, 0)), np.array([1.0, 0, 0])
    turned = turntable(camera, centre, 8)
    offsets = np.array([one.position for one in turned]) - centre
    np.testing.assert_allclose(np.linalg.norm(offsets, axis=1), np.linalg.norm([2, 1, 4]))
    np.testing.assert_allclose(offsets[:, 1], 1)
    np.testing.assert_allclose(offsets[2], [4, 1, -2], atol=1e-12)  # a quarter turn about +Y takes +z to +x
    for one, offset in zip(turned, offsets, strict=True):
        np.testing.assert_allclose(one.forward, -offset / np.linalg.norm(offset), atol=1e-12)


def test_a_path_goes_through_its_keys_evenly():
    keys = [Key((x, 1.0, 5.0), (x, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0) for x in (0.0, 1.0, 2.0)]
    found = along_path(keys, Camera.look_at((0, 0, 1), (0, 0, 0), width=6, height=4), 9)
    np.testing.assert_allclose([one.position[0] for one in found], np.linspace(0, 2, 9), atol=1e-12)
    assert {(one.width, one.height) for one in found} == {(6, 4)}
    np.testing.assert_allclose([one.fov_deg for one in found], 40)


def test_a_closed_path_has_no_corner_where_it_closes():
    corners = [(4, 0, 0), (0, 0, 4), (-4, 0, 0), (0, 0, -4), (4, 0, 0)]
    keys = [Key(tuple(map(float, c)), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), None) for c in corners]
    places = np.array([one.position for one in along_path(keys, Camera.look_at((0, 0, 1), (0, 0, 0)), 401)])
    first, last = places[1] - places[0], places[-1] - places[-2]
    np.testing.assert_allclose(first, last, atol=2e-3)
    assert np.linalg.norm(first) > 0.03


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no JSON"),
        ("{}", "no list"),
        ("[]", "no list"),
        ("[1]", r"\[0\]: it is no object"),
        ('[{"position": [0,0,1]}]', r"\[0\].target"),
        ('[{"position": [0,0,1], "target": [0,0,"x"]}]', r"\[0\].target"),
        ('[{"position": [0,0,NaN], "target": [0,0,0]}]', r"\[0\].position"),
        ('[{"position": [0,0,1], "target": [0,0,1]}]', "its own position"),
        ('[{"position": [0,0,1], "target": [0,0,0], "fov": 3}]', "unknown key 'fov'"),
        ('[{"position": [0,0,1], "target": [0,0,0], "fov_deg": 0}]', "field of view"),
    ],
)
def test_a_path_that_is_none(tmp_path, text, says):
    (tmp_path / "path.json").write_text(text)
    with pytest.raises(InputError, match=says):
        read_path(tmp_path / "path.json")


@pytest.mark.parametrize(
    ("out", "first"),
    [
        ("a.exr", "a_0001.exr"),
        ("a_##.png", "a_01.png"),
        ("a%03d.png", "a001.png"),
        ("a.b.png", "a.b_0001.png"),
        ("film.mp4", "film.mp4.frames/000001.png"),
    ],
)
def test_names_of_frames(tmp_path, out, first):
    assert FrameFiles.of(tmp_path / out, 12).frame(0) == tmp_path / first


def test_numbers_get_the_digits_that_they_need():
    assert FrameFiles.of("a.exr", 12345).frame(0).name == "a_00001.exr"


def test_a_killed_sequence_goes_on_and_ends_as_if_it_had_not_been_killed(paint, tmp_path, monkeypatch):  # noqa: F811
    whole = rsibr.render_sequence("sphere", paint, out=tmp_path / "whole.png", frames=4, **SETTINGS)
    render_picture, made = RenderJob.picture, []

    def dying(self, camera, **given):
        if camera.width == 8 and given.get("rays") is None:
            made.append(camera)
            if len(made) == 3:
                raise KeyboardInterrupt
        return render_picture(self, camera, **given)

    monkeypatch.setattr(RenderJob, "picture", dying)
    with pytest.raises(KeyboardInterrupt):
        rsibr.render_sequence("sphere", paint, out=tmp_path / "cut.png", frames=4, **SETTINGS)
    (tmp_path / "cut_0001.png").write_bytes(b"altered")
    again = rsibr.render_sequence("sphere", paint, out=tmp_path / "cut.png", frames=4, **SETTINGS)
    assert again.kept == 1
    assert again.exposure == whole.exposure
    for one, other in zip(whole.files, again.files, strict=True):
        assert one.read_bytes() == other.read_bytes()
    other_rays = SETTINGS | {"rays": 2}
    assert rsibr.render_sequence("sphere", paint, out=tmp_path / "cut.png", frames=4, **SETTINGS).kept == 4
    assert rsibr.render_sequence("sphere", paint, out=tmp_path / "cut.png", frames=4, **other_rays).kept == 0
    fresh = rsibr.render_sequence("sphere", paint, out=tmp_path / "cut.png", frames=4, fresh=True, **other_rays)
    assert fresh.kept == 0
    assert not [file for file in tmp_path.iterdir() if file.name.startswith(".")]


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_a_complete_sequence_prepares_nothing(paint, tmp_path, monkeypatch, name):  # noqa: F811
    first = rsibr.render_sequence("sphere", paint, out=tmp_path / "new" / name, frames=2, **SETTINGS)
    assert first.kept == 0
    monkeypatch.setattr(RenderJob, "renderer", property(lambda _self: pytest.fail("prepared")))
    again = rsibr.render_sequence("sphere", paint, out=tmp_path / "new" / name, frames=2, **SETTINGS)
    assert (again.kept, again.exposure, again.files) == (2, first.exposure, first.files)


def test_the_exposure_is_chosen_anew_for_other_cameras_only(paint, tmp_path, monkeypatch):  # noqa: F811
    chosen = []
    monkeypatch.setattr(sequence, "_common_exposure", lambda _job, cameras: chosen.append(cameras) or 2.0)
    above = {"direction": (0, 1, 0.1)}
    for given, times in (({}, 1), ({}, 1), ({"camera": above}, 2), ({"rays": 2}, 3), ({"rays": 2}, 3)):
        made = rsibr.render_sequence("sphere", paint, out=tmp_path / "a.png", frames=1, **{**SETTINGS, **given})
        assert (len(chosen), made.exposure) == (times, 2.0)


def test_another_object_under_the_same_name_is_not_the_same_sequence(paint, tmp_path):  # noqa: F811
    scene = two_spheres()
    for kept, bakes in ((0, paint), (2, paint)):
        assert rsibr.render_sequence(scene, bakes, out=tmp_path / "a.exr", frames=2, **SETTINGS).kept == kept
    scene.shapes.pop("left")
    smaller = type(scene)("spheres", scene.shapes)
    assert rsibr.render_sequence(smaller, paint, out=tmp_path / "a.exr", frames=2, **SETTINGS).kept == 0


FFMPEG = """#!/usr/bin/env python3
import glob, json, os, sys
pattern = sys.argv[sys.argv.index("-i") + 1]
frames = sorted(glob.glob(os.path.join(os.path.dirname(pattern), "*.png")))
open(sys.argv[-1], "w").write(json.dumps([os.path.basename(frame) for frame in frames]))
"""


def test_a_film_is_made_of_all_frames(paint, tmp_path, monkeypatch):  # noqa: F811
    tool = tmp_path / "bin" / "ffmpeg"
    tool.parent.mkdir()
    tool.write_text(FFMPEG)
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tool.parent), prepend=":")
    made = rsibr.render_sequence("sphere", paint, out=tmp_path / "film.mp4", frames=3, **SETTINGS)
    assert made.files == (tmp_path / "film.mp4",)
    assert json.loads((tmp_path / "film.mp4").read_text()) == ["000001.png", "000002.png", "000003.png"]
    tool.write_text("#!/bin/sh\necho no such codec >&2\nexit 1\n")
    again = rsibr.render_sequence("sphere", paint, out=tmp_path / "film.mp4", frames=3, **SETTINGS)
    assert again.kept == 3  # and the film is not encoded again
    (tmp_path / "film.mp4.frames" / "000002.png").unlink()
    (tmp_path / "film.mp4.frames" / "frames.json").unlink()
    with pytest.raises(MachineError, match="no such codec"):
        rsibr.render_sequence("sphere", paint, out=tmp_path / "film.mp4", frames=3, **SETTINGS)
    assert json.loads((tmp_path / "film.mp4").read_text())  # as it was


def test_a_film_without_ffmpeg_is_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MachineError, match="ffmpeg"):
        rsibr.render_sequence("gone.xml", "gone.rsibr", out=tmp_path / "film.mp4", frames=3)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("frames", [0, -1, 100_001])
def test_a_number_of_frames_out_of_range(tmp_path, frames):
    with pytest.raises(InputError, match="frames"):
        rsibr.render_sequence("gone.xml", "gone.rsibr", out=tmp_path / "a.exr", frames=frames)


def test_frames_without_the_object_are_made_with_a_note(paint, tmp_path):  # noqa: F811
    away = {"position": (0, 0, 4), "target": (9, 0, 4)}
    made = rsibr.render_sequence("sphere", paint, out=tmp_path / "a.exr", frames=1, camera=away, **SETTINGS)
    assert any("nothing of 'sphere' is seen" in note for note in made.notes)

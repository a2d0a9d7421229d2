"""`rsibr capture`: from photographs to a sky on the command line, and every mistake in one line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rsibr.capture.exr_parts import read_parts
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from tests.capture.skies import directions_as_colours, rel_mse, resized, with_a_sun
from tests.scene.maps import write_exr

MASKS = ["--mask", "shots/view_00_mask.png", "--mask", "shots/view_01_mask.png"]
FOV = ["--view", "0,0,1", "--fov", "9"]
VIEWS = ["--view", "0,0,1", "--view", "1,0,0"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Working folder with a sky."""
    monkeypatch.chdir(tmp_path)
    write_exr(tmp_path / "sky.exr", directions_as_colours(32).image)
    write_exr(tmp_path / "tiny.exr", np.ones((1, 2, 3)))
    (tmp_path / "void.xml").write_text('<scene version="3.0.0"></scene>')
    endless = '<emitter type="constant"><rgb name="radiance" value="1e38"/></emitter>'
    (tmp_path / "endless.xml").write_text(f'<scene version="3.0.0">{endless}</scene>')
    return tmp_path


def shots_of(folder, view):
    return sorted(folder.glob(f"shots/view_{view:02d}_shot_*.png"))


@pytest.mark.slow
def test_from_a_shoebox_to_a_sky(shell, folder):
    truth, _, _ = with_a_sun(64, half_angle_deg=2)
    write_exr(folder / "sky.exr", truth)
    common = ["--pixels", "300", "--samples", "25", "--seed", "3"]
    made = shell("capture", "synth", "sky.exr", *VIEWS, "--out", "shots", *common, "--shots", "10", "--json")
    assert made.code == 0, made.stderr
    assert made.json["photographs"] == 20
    gain = json.loads((folder / "shots" / "capture.json").read_text())["gain"]
    for view in (0, 1):
        ended = shell("capture", "hdr", *shots_of(folder, view), "--no-align", "--out", f"v{view}.exr", "--json")
        assert ended.code == 0, ended.stderr
    distance = ["--distance", "10"]
    ended = shell(
        "capture",
        "ball",
        "v0.exr",
        "v1.exr",
        *VIEWS,
        *MASKS,
        *distance,
        "--height",
        "32",
        "--out",
        "ball.exr",
        "--json",
    )
    assert ended.code == 0, ended.stderr
    assert ended.json["seen"] > 0.99
    parts = read_parts(folder / "ball.exr")
    dark = parts["radiance"] / gain < 3
    expected = resized(truth, 32)
    assert rel_mse(parts["radiance"] / gain, expected, dark.all(axis=2) & (expected.max(axis=2) < 3)) < 0.01
    used = shell("plan", write_sky_config(folder), "--json")
    assert used.code == 0, used.stderr


def write_sky_config(folder):
    path = folder / "config.toml"
    path.write_text(
        '[environment]\nfile = "ball.exr"\n[material]\npreset = "matte-lambert"\n'
        "[map]\nresolution = 16\n[sampling]\nsamples = 4\n"
    )
    return path


@pytest.mark.slow
def test_a_burnt_sun_is_found_by_a_matte_ball(shell, folder):
    truth, seen, saturated = with_a_sun(64, half_angle_deg=2)
    write_exr(folder / "sky.exr", truth)
    from rsibr.capture.exr_parts import encode_parts

    (folder / "ball.exr").write_bytes(encode_parts({"radiance": seen, "seen": ~saturated, "saturated": saturated}))
    view = ["--view", "4,2,9"]
    made = shell(
        "capture", "synth", "sky.exr", *view, "--ball", "matte:0.6", "--out", "shots", "--pixels", "96", "--bits", "16",
        "--curve", "linear", "--shots", "3", "--json",
    )  # fmt: skip
    assert made.code == 0, made.stderr
    gain = json.loads((folder / "shots" / "capture.json").read_text())["gain"]
    merged = shell(
        "capture", "hdr", *shots_of(folder, 0), "--exposures", "1,0.25,0.0625", "--curve", "linear", "--no-align",
        "--out", "matte.exr",
    )  # fmt: skip
    assert merged.code == 0, merged.stderr
    parts = read_parts(folder / "matte.exr")
    parts["radiance"] /= gain
    (folder / "matte.exr").write_bytes(encode_parts(parts))
    ended = shell(
        "capture", "sun", "ball.exr", "matte.exr", *view, "--distance", "10", "--mask", "shots/view_00_mask.png",
        "--reflectance", "0.6", "--out", "whole.exr", "--json",
    )  # fmt: skip
    assert ended.code == 0, ended.stderr
    assert ended.json["irradiance"] == pytest.approx([9, 8, 6], rel=0.02)
    assert load_environment(EnvironmentConfig(file=folder / "whole.exr")).image.max() > 300


def test_lamps_are_added_and_a_near_one_is_told(shell, folder):
    ended = shell(
        "capture", "light", "sky.exr", "--point", "0,5,0,100,0,0", "--directional", "1,0,0,0,2,0", "--disc",
        "0,0,1,5,0,0,3", "--out", "new/lit.exr", "--json",
    )  # fmt: skip
    assert ended.code == 0, ended.stderr
    assert [one["irradiance"] for one in ended.json["lamps"]] == [[4, 0, 0], [0, 2, 0], [0, 0, 3]]
    assert "5 radii away" in ended.json["notes"][0]
    lit = load_environment(EnvironmentConfig(file=folder / "new" / "lit.exr")).image
    assert np.array_equal(lit >= directions_as_colours(32).image, np.ones(lit.shape, bool))


def test_a_painting_says_that_it_is_one(shell, folder, rng):
    import cv2

    cv2.imwrite(str(folder / "painted.png"), rng.integers(0, 256, (16, 32, 3)).astype(np.uint8))
    ended = shell("capture", "painted", "painted.png", "--scale", "4", "--out", "painted.exr", "--json")
    assert ended.code == 0, ended.stderr
    assert "painted: painted.png by the curve srgb, white is 4" in ended.json["source"]
    import OpenEXR

    with OpenEXR.File(str(folder / "painted.exr")) as file:
        assert file.header()["rsibr:source"] == ended.json["source"]
    assert load_environment(EnvironmentConfig(file=folder / "painted.exr")).image.max() <= 4


def test_six_images(shell, folder):
    from rsibr.geometry.projections.faces import FACES

    for index, face in enumerate(FACES):
        write_exr(folder / f"{face}.exr", np.full((8, 8, 3), index + 1.0))
    ended = shell("capture", "six", "--faces", "{face}.exr", "--out", "six.exr", "--json")
    assert ended.code == 0, ended.stderr
    image = load_environment(EnvironmentConfig(file=folder / "six.exr")).image
    height, width = image.shape[:2]
    assert image[0].mean() == pytest.approx(3)  # +Y is up
    assert image[-1].mean() == pytest.approx(4)
    assert image[height // 2, width // 4, 0] == pytest.approx(1)  # +X a quarter round


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["hdr", "none.png"], "no such photograph"),
        (["hdr", "sky.exr", "--exposures", "1,x"], "'x' is no time"),
        (["hdr", "sky.exr", "--noise", "1"], "is not 2 numbers"),
        (["hdr", "sky.exr"], "no exposure"),
        (["ball", "sky.exr"], "Missing option '--view'"),
        (["ball", "sky.exr", "--view", "0,0"], "is not 3 numbers"),
        (["ball", "sky.exr", "--view", "0,0,1", "--view", "1,0,0"], "2 views for 1 photographs"),
        (["ball", "sky.exr", "--view", "0,0,1"], "--fov in degrees, or --distance"),
        (["ball", "sky.exr", "--view", "0,0,0", "--fov", "9", "--circle", "32,16,12"], "is no direction"),
        (["ball", "sky.exr", "--view", "0,0,1", "--fov", "9", "--reflectance", "Xx"], "unknown metal 'Xx'"),
        (["ball", "sky.exr", "--view", "0,0,1", "--fov", "400"], "field of view"),
        (["ball", "sky.exr", "--view", "0,0,1", "--fov", "9", "--height", "1"], "1 rows"),
        (["sun", "sky.exr", "sky.exr", "--view", "0,0,1", "--fov", "9"], "capture"),
        (["six"], "no images and no scene"),
        (["six", "--faces", "x.png"], "has no {face}"),
        (["six", "--faces", "{face}.png"], "no such photograph"),
        (["six", "--scene", "none.xml"], "no such scene"),
        (["light", "sky.exr"], "no lamps"),
        (["light", "sky.exr", "--point", "0,0,0,1,1,1"], "object's centre"),
        (["light", "none.exr", "--point", "0,1,0,1,1,1"], "none.exr"),
        (["painted", "sky.exr", "--scale", "-1"], "scale"),
        (["painted", "sky.exr", "--scale", "1"], "no picture of low dynamic range"),
        (["painted", "sky.exr", "--scale", "1e39"], "a scale of 1e+39"),
        (["hdr", "sky.exr", "--exposures", "1e300"], "1e+300 s"),
        (["hdr", "sky.exr", "--exposures", "1", "--noise", "1e-320,1"], "full_well"),
        (["ball", "sky.exr", "--view", "0,0,1", "--fov", "9", "--distance", "9"], "are both given"),
        (["ball", "sky.exr", *FOV, "--circle", "1,1,1", "--mask", "sky.exr"], "a circle and a mask are both given"),
        (["ball", "sky.exr", *FOV, "--circle", "900,900,12", "--height", "8"], "shows nothing of a ball"),
        (["ball", "sky.exr", *FOV, "--circle", "32,16,12", "--up", "nan,0,0"], "--up: nan,0,0 is no direction"),
        (["ball", "sky.exr", "--view", "0,0,1", "--distance", "1e12"], "a distance of 1e+12"),
        (["ball", "sky.exr", *FOV, "--reflectance", "1e-9"], "a reflectance of 1e-09"),
        (["light", "sky.exr", "--directional", "0,1,0,1e38,1,1"], "cannot be stored"),
        (["light", "sky.exr", "--point", "0,1,0,1,1,1", "--object-radius", "0"], "--object-radius: a radius of 0"),
        (["light", "tiny.exr", "--directional", "0,1,0,1,1,1"], "too few to place a lamp"),
        (["six", "--scene", "void.xml", "--samples", "0"], "0 paths a pixel"),
        (["six", "--scene", "void.xml", "--seed", "-1"], "a seed of -1"),
        (["six", "--scene", "void.xml", "--size", "4096", "--samples", "60000"], "of 60000 paths"),
        (["six", "--scene", "void.xml", "--size", "4", "--samples", "1"], "sends no light to 0,0,0"),
        (["six", "--scene", "endless.xml", "--size", "4", "--samples", "16"], "is not finite"),
    ],
    ids=lambda value: "-".join(value)[:40] if isinstance(value, list) else "",
)
def test_mistakes(shell, folder, words, says):
    shell.refuses("capture", *words, "--out", "out.exr", says=says)
    assert not (folder / "out.exr").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--ball", "glass:2"], "unknown preset"),
        (["--ball", "matte:3"], "reflectance"),
        (["--distance", "0.5"], "distance"),
        (["--distance", "inf"], "distance"),
        (["--seed", "-1"], "seed is -1"),
    ],
)
def test_mistakes_of_synth(shell, folder, words, says):
    shell.refuses("capture", "synth", "sky.exr", "--view", "0,0,1", "--out", "shots", *words, says=says)


@pytest.mark.parametrize("out", ["shot.png", "out.txt", "shot.exr"])
def test_no_photograph_is_written_over(shell, folder, out):
    (folder / "shot.png").write_bytes(b"a photograph")
    (folder / "shot.exr").write_bytes((folder / "sky.exr").read_bytes())
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    shell.refuses("capture", "hdr", "shot.png", "shot.exr", "--exposures", "1,2", "--out", out, says="--out: ")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_shots_of_an_earlier_run_are_not_left_among_those_of_another(shell, folder):
    common = ["synth", "sky.exr", "--view", "0,0,1", "--out", "shots", "--pixels", "8", "--samples", "1"]
    for count in ("3", "3"):
        assert shell("capture", *common, "--shots", count).code == 0
    shell.refuses("capture", *common, "--shots", "2", says="view_00_shot_2.png of an earlier run")


def test_files_of_other_programs_are_photographs_too(shell, folder):
    """OpenEXR with alpha, with one grey channel, and with a layer's name; only captures have more parts."""
    import OpenEXR

    sky = directions_as_colours(32).image
    for name, channels in (
        ("rgba", {"RGBA": np.concatenate([sky, sky[..., :1]], axis=2)}),
        ("grey", {"Y": np.ascontiguousarray(sky[..., 0])}),
        ("layer", {f"view.{letter}": np.ascontiguousarray(sky[..., k]) for k, letter in enumerate("RGB")}),
    ):
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
            file.write(str(folder / f"{name}.exr"))
        ball = ["ball", f"{name}.exr", *FOV, "--circle", "32,16,12", "--height", "4", "--reflectance", "1"]
        ended = shell("capture", *ball, "--out", f"{name}_sky.exr")
        assert ended.code == 0, ended.stderr
        found = read_parts(folder / f"{name}_sky.exr")["radiance"]
        assert found.min() >= sky.min()
        assert 0.2 < found.mean() < 0.8


def test_saturated_images_and_lamps_that_no_camera_sees_are_told(shell, folder):
    import cv2

    from rsibr.geometry.projections.faces import FACES

    for face in FACES:
        cv2.imwrite(str(folder / f"{face}.png"), np.full((4, 4, 3), 255 if face == "py" else 99, np.uint8))
    ended = shell("capture", "six", "--faces", "{face}.png", "--out", "six.exr", "--json")
    assert ended.code == 0, ended.stderr
    assert "16.7% of the pixels are saturated" in ended.json["notes"][0]
    lamp = '<emitter type="point"><point name="position" x="0" y="1" z="0"/></emitter>'
    (folder / "lamp.xml").write_text(f'<scene version="3.0.0">{lamp}</scene>')
    ended = shell("capture", "six", "--scene", "lamp.xml", "--size", "4", "--samples", "1", "--out", "s.exr", "--json")
    assert ended.code == 0, ended.stderr
    assert "PointLight: seen by no camera" in ended.json["notes"][0]


def test_a_picture_of_another_shape_is_told(shell, folder):
    import cv2

    cv2.imwrite(str(folder / "square.png"), np.full((16, 16, 3), 99, np.uint8))
    ended = shell("capture", "painted", "square.png", "--scale", "1", "--out", "painted.exr", "--json")
    assert ended.code == 0, ended.stderr
    assert "light probe" in ended.json["notes"][0]


def test_the_group_alone_lists_its_commands(shell):
    ended = shell("capture")
    assert ended.code == 0
    assert "error" not in ended.stderr
    assert ended.stdout == shell("capture", "--help").stdout
    assert "  synth " in ended.stdout

"""Environment files that earlier versions got wrong: the picture that the file states, or one clear line."""

from __future__ import annotations

import os

import numpy as np
import OpenEXR
import pytest

from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.methods.reconstruction import reconstruct
from rsibr.scene.config import load_config
from rsibr.scene.environment import load_environment
from rsibr.scene.latlong import read_latlong
from tests.cli.command import Shell
from tests.faults.cases import case

PANORAMA = case("roughplastic_no_specular_nan", "exr_plain.exr")
"""The picture that most of the cases hold in one way or another."""


def read(name, file, **keys):
    return read_latlong(case(name, file), **keys)


def refusal(name, file, **keys):
    with pytest.raises(InputError) as caught:
        read(name, file, **keys)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def shell(monkeypatch, capsys):
    return Shell(monkeypatch, capsys)


@pytest.fixture(scope="module")
def panorama():
    return read_latlong(PANORAMA).image


def test_the_panorama_is_what_openexr_reads(panorama):
    assert panorama.sum(dtype=np.float64) == pytest.approx(2583.293, abs=1e-3)


@pytest.mark.parametrize("file", ["exr_neg.exr", "exr_overscan.exr"])
def test_exr_negative_window_segv(panorama, file):
    np.testing.assert_array_equal(read("exr_negative_window_segv", file).image, panorama)


def test_exr_aces_white():
    found = read("exr_aces_white", "exr_acescg_grey.exr")
    np.testing.assert_allclose(found.image, 0.5, atol=2e-4)
    assert "adapted to D65 (Bradford)" in found.notes[0]


def test_exr_cube_attribute(tmp_path):
    """A mirror seen from each axis shows the face that looks to the viewer, in the middle."""
    config = load_config(case("exr_cube_attribute"), ["map.resolution=9", "sampling.samples=4"])
    baked = bake(config, out=tmp_path / "cube.rsibr")
    faces = {(1, 0, 0): (1, 0, 0), (-1, 0, 0): (0, 1, 1), (0, 1, 0): (0, 0, 1), (0, -1, 0): (1, 1, 0)}
    faces |= {(0, 0, 1): (0, 1, 0), (0, 0, -1): (1, 0, 1)}
    for view, colour in faces.items():
        image = reconstruct(baked, view, method="rsibr").image
        np.testing.assert_allclose(image[4, 4], colour, atol=1e-3)


def test_exr_layers(panorama):
    assert "several pictures: albedo, beauty. Choose one with environment.layer" in refusal(
        "exr_layers", "exr_BGR_layers.exr"
    )
    assert "several pictures: Normal, View" in refusal("exr_layers", "exr_two_layers.exr")
    chosen = load_environment(load_config(case("exr_layers"), ["environment.layer=beauty"]).environment)
    np.testing.assert_array_equal(chosen.image, panorama)
    np.testing.assert_array_equal(read("exr_layers", "exr_two_layers.exr", layer="View").image, panorama)


def test_exr_xyz_channels():
    xyz_to_rec709 = np.array(
        [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
    )
    found = read("exr_xyz_channels", "exr_xyzch.exr")
    with OpenEXR.File(str(case("exr_xyz_channels", "exr_xyzch.exr"))) as file:
        xyz = np.stack([file.channels()[name].pixels for name in "XYZ"], axis=-1)
    expected = np.maximum(xyz @ xyz_to_rec709.T, 0.0)
    np.testing.assert_allclose(found.image, expected, atol=2e-3 * expected.max())


def test_hdr_exposure(panorama):
    np.testing.assert_array_equal(read("hdr_exposure", "hdr_exp4_const.hdr").image, 1.0)
    for file in ("hdr_colorcorr.hdr", "hdr_prim2020.hdr"):
        off = np.abs(read("hdr_exposure", file).image - panorama) / panorama.max(axis=2, keepdims=True)
        assert off.max() < 0.04  # eight bits, of a channel that was doubled
        assert off.mean() < 0.01


@pytest.mark.parametrize("file", ["hdr_pYpX.hdr", "hdr_mYmX.hdr", "hdr_pXmY.hdr", "hdr_oldrle.hdr"])
def test_hdr_orientation(panorama, file):
    off = np.abs(read("hdr_orientation", file).image - panorama)
    assert (off <= panorama.max(axis=2, keepdims=True) / 128).all()


def test_hdr_xyze_header(panorama):
    assert "holds XYZ, not RGB" in refusal("hdr_xyze_header", "hdr_xyze_late.hdr")
    off = np.abs(read("hdr_xyze_header", "hdr_comment_xyze.hdr").image - panorama)
    assert (off <= panorama.max(axis=2, keepdims=True) / 128).all()


def test_square_probe(shell):
    said = " ".join(shell("plan", case("square_probe")).stdout.split())
    assert "note: hdr_probe: its 48 × 48 texels (1:1) look like a light probe" in said


def test_notes_are_said_by_a_bake_and_kept(shell, tmp_path):
    out = tmp_path / "x.rsibr"
    small = ["--set", "map.resolution=8", "--set", "sampling.samples=4"]
    for again, count in (([], 1), ([], 0), (["--verbose"], 1)):  # baked, found finished, and asked for
        ended = shell("bake", case("exr_aces_white"), "--out", out, *small, *again)
        assert " ".join(ended.stderr.split()).count("white (0.3217, 0.3377) adapted to D65") == count


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"\x76\x2f", "has only 2 bytes"),
        (b"\x89PNG\r\n\x1a\n", "it is a PNG"),
        (b"\xff\xd8\xff\xe0", "it is a JPEG"),
        (b"II*\0abcd", "it is a TIFF"),
        (b"PF\n2 1\n-1\n", "it is a PFM"),
        (b"<!DOCTYPE html>", "it is text"),
        (b"\x1f\x8b\x08", "compressed with gzip"),
        (bytes(100), "zeros only"),
    ],
)
def test_another_format_is_named(tmp_path, content, says):
    path = tmp_path / "sky.exr"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_latlong(path)
    assert says in str(caught.value)


def test_what_is_no_regular_file_is_never_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.hdr")
    (tmp_path / "link.exr").symlink_to(tmp_path / "pipe.hdr")
    for path, kind in (
        (tmp_path, "a folder"),
        (tmp_path / "pipe.hdr", "a named pipe"),
        (tmp_path / "link.exr", "a named pipe"),
    ):
        with pytest.raises(InputError, match=f"is {kind}, not a file"):
            read_latlong(path)
    with pytest.raises(InputError, match="is a device"):
        read_latlong("/dev/zero")
    with pytest.raises(InputError, match="no such environment map"):
        read_latlong(tmp_path / "gone.exr")


def test_a_layer_belongs_to_a_file():
    with pytest.raises(InputError, match="layer chooses a picture of a file"):
        load_config(case("directional_black"), ["environment.layer=sky"])

"""Radiance pictures: headers, orders of the texels, run lengths, and what is refused for its true reason."""

from __future__ import annotations

import itertools

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.scene.latlong import read_latlong
from tests.scene.maps import refusal

RGBE = "FORMAT=32-bit_rle_rgbe"


@pytest.fixture
def texels(rng):
    """RGBE texels (6, 10, 4) with runs; exponents about 1, and some black."""
    made = rng.integers(3, 256, (6, 10, 4), dtype=np.uint8)
    made[..., 3] = rng.integers(126, 131, (6, 10))
    made[1, 2:9] = made[1, 2]
    made[3] = (1, 2, 3, 0)
    return made


def decoded(texels):
    scale = np.where(texels[..., 3] > 0, 2.0 ** (texels[..., 3].astype(float) - 136.0), 0.0)
    return texels[..., :3] * scale[..., None]


def written(path, texels, *lines, resolution=None, end="\n", body=None):
    height, width = texels.shape[:2]
    resolution = resolution or f"-Y {height} +X {width}"
    header = end.join(["#?RADIANCE", *(lines or [RGBE]), "", resolution]) + end
    path.write_bytes(header.encode() + (texels.tobytes() if body is None else body))
    return path


@pytest.mark.parametrize(("y", "x", "upright"), list(itertools.product("+-", "+-", [True, False])))
def test_all_orders_of_the_texels(tmp_path, texels, y, x, upright):
    stored = texels[:: -1 if y == "+" else 1, :: 1 if x == "+" else -1]
    axes = [f"{y}Y 6", f"{x}X 10"]
    if not upright:
        stored, axes = np.swapaxes(stored, 0, 1), axes[::-1]
    path = written(tmp_path / "a.hdr", texels, resolution=" ".join(axes), body=stored.tobytes())
    np.testing.assert_array_equal(read_latlong(path).image, decoded(texels))


def test_every_value_is_what_mitsuba_reads(tmp_path):
    """All exponents, so that maps of earlier versions keep their bits."""
    texels = np.stack([np.arange(256) % 251, 255 - np.arange(256), np.full(256, 7), np.arange(256)], axis=-1)
    path = written(tmp_path / "a.hdr", texels.astype(np.uint8).reshape(8, 32, 4))
    read = np.array(mi.Bitmap(str(path)))
    np.testing.assert_array_equal(read_latlong(path).image, read)
    mi.Bitmap(read).write(str(tmp_path / "b.hdr"))
    np.testing.assert_array_equal(read_latlong(tmp_path / "b.hdr").image, np.array(mi.Bitmap(str(tmp_path / "b.hdr"))))


@pytest.mark.parametrize(
    ("body", "columns"),
    [
        ([(9, 8, 7, 130), (1, 1, 1, 3), (5, 5, 5, 129)], [0, 0, 0, 0, 1]),
        ([(9, 8, 7, 130), (1, 1, 1, 44), (1, 1, 1, 1)], [0] * 301),  # 44 + 256: the digits of one number
        ([(9, 8, 7, 130), (1, 1, 1, 0), (1, 1, 1, 1)], [0] * 257),
        ([(9, 8, 7, 130), (1, 1, 1, 1), (5, 5, 5, 129), (1, 1, 1, 2)], [0, 0, 1, 1, 1]),
        ([(9, 8, 7, 130), (1, 1, 1, 0), (1, 1, 1, 0), (1, 1, 1, 0), (5, 5, 5, 129)], [0, 1]),
        ([(9, 8, 7, 130), (1, 1, 1, 200)], [0] * 5),  # what goes beyond the line is left out
        ([(1, 1, 1, 130), (1, 1, 1, 2)], [0] * 3),  # the first texel is never a run
    ],
)
def test_old_run_lengths(tmp_path, body, columns):
    quads = np.array(body, np.uint8)
    colours = decoded(quads)
    literal = [0, *(i for i in range(1, len(body)) if body[i][:3] != (1, 1, 1))]
    expected = np.stack([colours[literal[column]] for column in columns])[None]
    line = np.empty((2, len(columns), 4), np.uint8)
    path = written(tmp_path / "a.hdr", line, body=2 * quads.tobytes())
    np.testing.assert_array_equal(read_latlong(path).image, np.repeat(expected, 2, axis=0))


def test_exposures_and_corrections_multiply(tmp_path, texels):
    lines = ["EXPOSURE=4.0", "EXPOSURE= 5e-1", "COLORCORR= 2 1 .5", RGBE, "\tEXPOSURE=100", "COLORCORR=1 1 4"]
    path = written(tmp_path / "a.hdr", texels, *lines)
    np.testing.assert_allclose(read_latlong(path).image, decoded(texels) / [4.0, 2.0, 4.0], rtol=1e-6)


def test_the_last_primaries_count_and_grey_stays_grey(tmp_path):
    grey = np.full((4, 8, 4), 128, np.uint8)
    lines = ["PRIMARIES= .708 .292 .17 .797 .131 .046 .3127 .3290", "PRIMARIES= .64 .33 .29 .6 .15 .06 .3333 .3333"]
    read = read_latlong(written(tmp_path / "a.hdr", grey, *lines, RGBE))
    np.testing.assert_allclose(read.image, 0.5, rtol=1e-6)
    assert "(0.3333, 0.3333) adapted to D65" in read.notes[0]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_lines_and_lengths_of_the_header(tmp_path, texels, end):
    path = written(tmp_path / "a.hdr", texels, *["# 32-bit_rle_xyze" + 99 * "y"] * 300, f"FORMAT= {RGBE[7:]} ", end=end)
    np.testing.assert_array_equal(read_latlong(path).image, decoded(texels))


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["SOFTWARE=x"], "has no FORMAT line"),
        (["FORMAT=32-bit_rle_xyze"], "holds XYZ, not RGB"),
        (["# y" * 3000, "FORMAT=32-bit_rle_xyze"], "holds XYZ, not RGB"),
        (["FORMAT=Radiance_spectra"], "has FORMAT=Radiance_spectra"),
        ([RGBE, "FORMAT=ascii"], "several FORMAT lines: 32-bit_rle_rgbe, ascii"),
        ([RGBE, "GAMMA=2.2"], "its values are not linear"),
        *(
            ([RGBE, f"EXPOSURE={value}"], f"has EXPOSURE={value}")
            for value in ("0", "-1", "nan", "inf", "1,5", "", "0x2")
        ),
        ([RGBE, "EXPOSURE=1e40"], "multiply to 1e+40"),
        ([RGBE, *["EXPOSURE=1e-29"] * 2], "multiply to 1e-58"),
        ([RGBE, "COLORCORR=1 1"], "COLORCORR=1 1, not 3 numbers"),
        ([RGBE, "COLORCORR=1 0 1"], "not positive"),
        ([RGBE, "PRIMARIES=0.64 0.33"], "PRIMARIES=0.64 0.33, not 8 numbers"),
        ([RGBE, "PRIMARIES=0 0 0 0 0 0 0 0"], "states"),
    ],
)
def test_headers_that_cannot_be_obeyed(tmp_path, texels, lines, says):
    assert says in refusal(written(tmp_path / "a.hdr", texels, *lines))


@pytest.mark.parametrize(
    "line", ["-Y 6 -Y 10", "-Y 6", "-Y 0 +X 10", "-Y 6 +X -10", "6 10", "-Z 6 +X 10", "-Y 6 +X 1e1"]
)
def test_resolution_lines_that_are_none(tmp_path, texels, line):
    assert f"resolution line is '{line}'" in refusal(written(tmp_path / "a.hdr", texels, resolution=line))


def test_truncation_names_the_scan_line(tmp_path, texels):
    path = written(tmp_path / "a.hdr", texels)
    path.write_bytes(path.read_bytes()[:-41])
    assert "is truncated: it ends in scan line 4 of 6" in refusal(path)
    path = written(tmp_path / "a.hdr", texels, body=b"\x02\x02\x00\x0a\x8a\x01\x8a\x02\x8a\x03\x8a")
    assert "is truncated: it ends in scan line 0 of 6" in refusal(path)
    path.write_bytes(path.read_bytes().partition(b"\n\n")[0])
    assert "its header has no end" in refusal(path)


def test_damaged_run_lengths_are_not_called_truncated(tmp_path, texels):
    run = b"\x02\x02\x00\x0a" + b"\x89\x01" + b"\x84\x01"
    assert "is damaged in scan line 0: a run goes beyond its end" in refusal(
        written(tmp_path / "a", texels, body=run * 9)
    )
    other = b"\x02\x02\x00\x0b" + bytes(200)
    assert "is damaged in scan line 0: it has 11 texels, not 10" in refusal(written(tmp_path / "a", texels, body=other))


@pytest.mark.parametrize(
    "resolution", ["-Y 2147483647 +X 2147483647", "-Y 32768 +X 32767", "-Y 9999999999 +X 9999999999"]
)
def test_claims_without_texels_are_refused_at_once(tmp_path, texels, resolution):
    said = refusal(written(tmp_path / "a.hdr", texels, resolution=resolution))
    assert "texels are more than" in said or "truncated" in said


def test_what_is_left_over_and_other_projections_are_told(tmp_path, texels):
    path = written(tmp_path / "a.hdr", texels, "VIEW= -vta -vv 360 -vh 360", RGBE, body=texels.tobytes() + bytes(7))
    notes = read_latlong(path).notes
    assert any("angular fisheye" in note for note in notes)
    assert any("7 bytes after" in note for note in notes)


def test_a_radiance_picture_has_no_layers(tmp_path, texels):
    with pytest.raises(InputError, match="no layers"):
        read_latlong(written(tmp_path / "a.hdr", texels), layer="sky")

"""Reading of latitude–longitude maps: formats, channels, and files that are broken."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from rsibr.resources import scenes
from rsibr.scene.latlong import read_latlong
from tests.scene.maps import refusal, write_channels, write_exr


def plane(image, channel):
    return np.ascontiguousarray(image[..., channel])


def test_float_rgb_comes_back_bit_for_bit(tmp_path, image):
    np.testing.assert_array_equal(read_latlong(write_exr(tmp_path / "a.exr", image)).image, image)


def test_half_comes_back_as_float32(tmp_path, image):
    path = write_channels(tmp_path / "a.exr", {"RGB": image.astype(np.float16)})
    read = read_latlong(path).image
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, image.astype(np.float16).astype(np.float32))


def test_alpha_is_left_out(tmp_path, image):
    rgba = np.dstack([image, np.full(image.shape[:2], 0.5, np.float32)])
    np.testing.assert_array_equal(read_latlong(write_channels(tmp_path / "a.exr", {"RGBA": rgba})).image, image)


def test_single_luminance_is_grey(tmp_path, image):
    path = write_channels(tmp_path / "a.exr", {"Y": plane(image, 0)})
    np.testing.assert_array_equal(read_latlong(path).image, np.repeat(image[..., :1], 3, axis=2))


def test_a_named_layer_is_found_among_other_channels(tmp_path, image):
    channels = {f"View.{name}": plane(image, i) for i, name in enumerate("RGB")}
    path = write_channels(tmp_path / "a.exr", {**channels, "Z": plane(image, 0)})
    np.testing.assert_array_equal(read_latlong(path).image, image)


def test_primaries_in_the_header_are_converted(tmp_path):
    """White of ACEScg becomes white of Rec.709; its pure green lies outside: red and blue below zero, clipped."""
    acescg = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    image = np.array([[[1, 1, 1], [0, 1, 0]]] * 2, dtype=np.float32)
    read = read_latlong(write_channels(tmp_path / "a.exr", {"RGB": image}, chromaticities=acescg))
    np.testing.assert_allclose(read.image[0, 0], 1.0, rtol=1e-6)
    np.testing.assert_array_equal(read.image[0, 1] > 0.0, [False, True, False])
    assert read.clipped == 4


@pytest.mark.parametrize("suffix", ["hdr", "pic"])
def test_radiance_hdr(tmp_path, image, suffix):
    mi.Bitmap(image).write(str(tmp_path / "a.hdr"))
    path = (tmp_path / "a.hdr").rename(tmp_path / f"b.{suffix}")
    largest = image.max(axis=2, keepdims=True)
    assert (np.abs(read_latlong(path).image - image) <= largest / 128).all()  # eight bits share the largest's exponent


@pytest.mark.parametrize(("value", "name"), [(np.nan, "NaN"), (np.inf, "Inf"), (-np.inf, "Inf")])
def test_hc25_not_finite_names_file_texel_and_channel(tmp_path, image, value, name):
    image[3, 5, 1] = value
    text = refusal(write_exr(tmp_path / "a.exr", image))
    assert f"texel (row 3, column 5) is {name} in channel G" in text
    assert "more values" not in text
    image[7, 2, 0] = value
    assert "1 more values are not finite" in refusal(write_exr(tmp_path / "a.exr", image))


@pytest.mark.parametrize("kept", [0, 4, 100, 350, 400, 0.5, -1000, -1])
def test_a_truncated_exr_is_refused_and_nothing_is_printed(tmp_path, rng, kept, capfd):
    path = write_exr(tmp_path / "a.exr", rng.random((100, 64, 3)))
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content)) if isinstance(kept, float) else kept])
    refusal(path)
    assert capfd.readouterr() == ("", "")


def test_a_truncated_hdr_is_refused(tmp_path, image):
    path = tmp_path / "a.hdr"
    mi.Bitmap(image).write(str(path))
    path.write_bytes(path.read_bytes()[:-40])
    assert "truncated" in refusal(path)


def test_files_that_are_no_radiance_map(tmp_path, image):
    path = tmp_path / "a.exr"
    assert "there is no such environment map" in refusal(path)
    assert "is a folder" in refusal(tmp_path)
    path.write_bytes(b"<html>not found</html>")
    assert "neither OpenEXR nor Radiance HDR" in refusal(path)
    mi.Bitmap((255 * image).astype(np.uint8)).write(str(tmp_path / "a.png"))
    assert "neither OpenEXR nor Radiance HDR" in refusal(tmp_path / "a.png")


def test_channels_that_are_no_radiance(tmp_path, image):
    path = tmp_path / "a.exr"
    assert "has the channels A" in refusal(write_channels(path, {"A": plane(image, 0)}))
    counts = {name: plane(image, 0).astype(np.uint32) for name in "RGB"}
    assert "uint32" in refusal(write_channels(path, counts))


def test_a_cropped_panorama_is_refused(tmp_path, image):
    whole = (np.array([0, 0], np.int32), np.array([23, 23], np.int32))
    path = write_channels(tmp_path / "a.exr", {"RGB": image}, displayWindow=whole)
    assert "only a part" in refusal(path)


def test_xyz_hdr_is_refused(tmp_path, image):
    path = tmp_path / "a.hdr"
    mi.Bitmap(image).write(str(path))
    path.write_bytes(path.read_bytes().replace(b"rle_rgbe", b"rle_xyze"))
    assert "holds XYZ" in refusal(path)


def test_hc29_too_many_texels_names_the_limit(tmp_path, image):
    assert "24 × 12 texels are more than 100" in refusal(write_exr(tmp_path / "a.exr", image), most_texels=100)


@pytest.mark.parametrize(("name", "lowest"), [("city", -0.0016), ("courtyard", -0.0032)])
def test_the_maps_that_come_along_are_readable(name, lowest):
    read = read_latlong(scenes() / "environments" / f"{name}.exr")
    assert read.image.shape == (512, 1024, 3)
    assert read.clipped > 0
    assert read.lowest == pytest.approx(lowest, abs=1e-4)

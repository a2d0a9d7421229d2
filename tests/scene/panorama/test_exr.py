"""OpenEXR files: windows, layers, parts, colours that headers state, and files that crash or hang what reads them."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import threading
import time

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

from rsibr.errors import InputError
from rsibr.scene.interpreter import OVERRIDE
from rsibr.scene.latlong import read_latlong
from rsibr.scene.panorama import exr, exr_server
from tests.scene.maps import refusal, write_channels, write_exr

ACESCG = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)


def layers(**images):
    """Channels of layers; `root` has no prefix."""
    return {
        f"{'' if name == 'root' else name + '.'}{channel}": np.ascontiguousarray(picture[..., i])
        for name, picture in images.items()
        for i, channel in enumerate("RGB")
    }


def write_parts(path, *parts, **header):
    made = [
        OpenEXR.Part({"compression": OpenEXR.ZIP_COMPRESSION, **header}, channels, name) for name, channels in parts
    ]
    with OpenEXR.File(made) as file:
        file.write(str(path))
    return path


def window(left, top, right, bottom):
    return np.array([left, top], np.int32), np.array([right, bottom], np.int32)


@pytest.mark.parametrize("kind", [np.float32, np.float16])
@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ"])
def test_lossless_files_have_the_bits_that_mitsuba_reads(tmp_path, image, kind, compression):
    values = {"RGB": image.astype(kind)}
    path = write_channels(tmp_path / "a.exr", values, compression=getattr(OpenEXR, f"{compression}_COMPRESSION"))
    np.testing.assert_array_equal(read_latlong(path).image, np.array(mi.Bitmap(str(path))).astype(np.float32))


@pytest.mark.parametrize("corner", [(0, 0), (-12, -6), (7, 9), (-(2**25), 2**25)])
def test_a_window_may_begin_anywhere(tmp_path, image, corner):
    box = window(*corner, corner[0] + 23, corner[1] + 11)
    path = write_channels(tmp_path / "a.exr", {"RGB": image}, dataWindow=box, displayWindow=box)
    np.testing.assert_array_equal(read_latlong(path).image, image)


def test_overscan_is_cut_off_exactly_and_told(tmp_path, image):
    path = write_channels(
        tmp_path / "a.exr", {"RGB": image}, dataWindow=window(-3, -1, 20, 10), displayWindow=window(0, 0, 18, 9)
    )
    read = read_latlong(path)
    np.testing.assert_array_equal(read.image, image[1:11, 3:22])
    assert "overscan" in read.notes[0]


@pytest.mark.parametrize(
    "display", [(-1, 0, 23, 11), (0, 0, 24, 11), (0, -1, 23, 11), (0, 0, 23, 12), (100, 0, 120, 11)]
)
def test_a_part_of_a_panorama_is_refused(tmp_path, image, display):
    path = write_channels(tmp_path / "a.exr", {"RGB": image}, displayWindow=window(*display))
    assert "shows only a part of its panorama" in refusal(path)


def test_an_envmap_attribute_with_two_windows_is_refused(tmp_path, image):
    keys = {"displayWindow": window(1, 1, 22, 10), "envmap": OpenEXR.ENVMAP_LATLONG}
    assert "envmap attribute refers to its data window" in refusal(
        write_channels(tmp_path / "a", {"RGB": image}, **keys)
    )


def test_tiles_and_a_falling_line_order_change_nothing(tmp_path, image):
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize, tiles.mode = 8, 5, OpenEXR.ONE_LEVEL
    path = write_channels(tmp_path / "t.exr", {"RGB": image}, type=OpenEXR.tiledimage, tiles=tiles)
    np.testing.assert_array_equal(read_latlong(path).image, image)
    path = write_channels(tmp_path / "d.exr", {"RGB": image}, lineOrder=OpenEXR.DECREASING_Y, pixelAspectRatio=2.0)
    np.testing.assert_array_equal(read_latlong(path).image, image)


def test_several_layers_are_refused_until_one_is_chosen(tmp_path, image):
    path = write_channels(tmp_path / "a.exr", layers(albedo=0 * image, beauty=image))
    assert "several pictures: albedo, beauty. Choose one with environment.layer" in refusal(path)
    np.testing.assert_array_equal(read_latlong(path, layer="beauty").image, image)
    assert "has no picture named 'beaut', but albedo, beauty" in refusal(path, layer="beaut")


def test_channels_without_a_layer_are_the_default_of_a_file(tmp_path, image):
    path = write_channels(tmp_path / "a.exr", layers(albedo=0 * image, root=image))
    read = read_latlong(path)
    np.testing.assert_array_equal(read.image, image)
    assert "albedo" in read.notes[0]
    assert not read_latlong(path, layer="albedo").image.any()
    np.testing.assert_array_equal(read_latlong(path, layer="RGB").image, image)


def test_several_parts_are_refused_until_one_is_chosen(tmp_path, image):
    path = write_parts(tmp_path / "a.exr", ("first", layers(root=0 * image)), ("sky", layers(root=image)))
    assert "several pictures: first, sky" in refusal(path)
    np.testing.assert_array_equal(read_latlong(path, layer="sky").image, image)
    mixed = [("one", layers(root=0 * image, fog=image)), ("two", {"Z": image[..., 0].copy()})]
    path = write_parts(tmp_path / "b.exr", *mixed)
    assert "several pictures: one, one/fog" in refusal(path)
    for name in ("one/fog", "fog"):
        np.testing.assert_array_equal(read_latlong(path, layer=name).image, image)
    assert not read_latlong(path, layer="one").image.any()


def test_a_part_of_depth_leaves_one_picture(tmp_path, image):
    path = write_parts(tmp_path / "a.exr", ("depth", {"Z": image[..., 0].copy()}), ("sky", layers(root=image)))
    np.testing.assert_array_equal(read_latlong(path).image, image)


def test_the_first_view_of_a_stereo_file_is_its_default(tmp_path, image):
    path = write_channels(tmp_path / "a.exr", layers(root=image, left=0 * image), multiView=["right", "left"])
    read = read_latlong(path)
    np.testing.assert_array_equal(read.image, image)
    assert "left" in read.notes[0]
    np.testing.assert_array_equal(read_latlong(path, layer="right").image, image)
    assert not read_latlong(path, layer="left").image.any()


def test_positions_beside_a_picture_are_not_colours(tmp_path, image):
    position = {f"P.{name}": image[..., 0].copy() for name in "XYZ"}
    path = write_channels(tmp_path / "a.exr", layers(sky=image) | position)
    np.testing.assert_array_equal(read_latlong(path).image, image)


@pytest.mark.parametrize("names", ["YZ", "YR", "RG", "A", "rgb", ("Y", "RY", "BY")])
def test_channels_that_are_no_picture_are_listed(tmp_path, image, names):
    said = refusal(write_channels(tmp_path / "a.exr", {name: image[..., 0].copy() for name in names}))
    assert "luminance and chroma" in said if "RY" in names else ", ".join(sorted(names)) in said


def test_xyz_channels_become_rec709(tmp_path, image):
    xyz = image @ np.array(
        [[0.4124564, 0.2126729, 0.0193339], [0.3575761, 0.7151522, 0.119192], [0.1804375, 0.072175, 0.9503041]]
    )
    path = write_channels(tmp_path / "a.exr", {name: xyz[..., i].astype(np.float32) for i, name in enumerate("XYZ")})
    np.testing.assert_allclose(read_latlong(path).image, image, atol=1e-3)


@pytest.mark.parametrize("header", [{"chromaticities": ACESCG}, {"colorInteropID": "lin_ap1_scene"}])
def test_stated_colours_are_converted_and_told(tmp_path, header):
    path = write_channels(tmp_path / "a.exr", {"RGB": np.full((4, 8, 3), 0.5, np.float32)}, **header)
    read = read_latlong(path)
    np.testing.assert_allclose(read.image, 0.5, rtol=1e-5)
    assert "white (0.3217, 0.3377) adapted to D65" in read.notes[0]


def test_an_aces_container_states_its_colours(tmp_path):
    values = {"RGB": np.tile(np.float32([0.0, 1.0, 0.0]), (4, 8, 1))}
    read = read_latlong(write_channels(tmp_path / "a.exr", values, acesImageContainerFlag=1)).image[0, 0]
    assert read[1] > 1.3
    assert (read[[0, 2]] == 0.0).all()  # its green lies outside Rec.709


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ({"colorInteropID": "srgb_rec709_scene"}, "colorInteropID is 'srgb_rec709_scene', no scene-linear"),
        (
            {"colorInteropID": "lin_ap1_scene", "chromaticities": (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)},
            "two",
        ),
        ({"envmap": "cube"}, "attribute envmap is 'cube', no layout"),
        ({"envmap": OpenEXR.ENVMAP_CUBE}, "not six square faces"),
        ({"whiteLuminance": "bright"}, "attribute whiteLuminance is 'bright', not 1 numbers"),
        ({"chromaticities": (0.64, 0.33, 0.64, 0.33, 0.15, 0.06, 0.3127, 0.329)}, "define no colours"),
        ({"adoptedNeutral": np.array([0.3, 0.0], np.float32)}, "states the white (0.3, 0)"),
    ],
)
def test_attributes_that_cannot_be_obeyed(tmp_path, image, header, says):
    assert says in refusal(write_channels(tmp_path / "a.exr", {"RGB": image}, **header))


def test_what_is_not_applied_is_told(tmp_path, image):
    header = {"whiteLuminance": 100.0, "oiio:ColorSpace": "sRGB"}
    notes = read_latlong(write_channels(tmp_path / "a.exr", {"RGB": image}, **header)).notes
    assert any("whiteLuminance (100 cd/m²" in note for note in notes)
    assert any("oiio:ColorSpace is 'sRGB'" in note for note in notes)


def test_deep_data_and_counts_are_refused(tmp_path, image):
    deep = np.empty((4, 8), dtype=object)
    for texel in np.ndindex(4, 8):
        deep[texel] = np.ones(2, np.float32)
    channels = dict.fromkeys("RGB", deep)
    keys = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    assert "deep data" in refusal(write_channels(tmp_path / "a.exr", channels, **keys))
    mixed = {"R": image[..., 0].copy(), "G": image[..., 1].copy(), "B": image[..., 2].astype(np.uint32)}
    assert "uint32" in refusal(write_channels(tmp_path / "b.exr", mixed))


def patched(path, attribute, value):
    """Overwrite the value of an attribute, which OpenEXR's package would not write."""
    data = bytearray(path.read_bytes())
    at = data.index(attribute) + len(attribute) + 4
    data[at : at + len(value)] = value
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    "box", [(0, 0, 2**31 - 2, 11), (-(2**31), 0, 2**31 - 1, 11), (5, 5, 0, 0), (0, 0, 30000, 30000), (0, 0, 23, 2**30)]
)
def test_claims_of_a_window_are_refused_at_once(tmp_path, image, box):
    path = write_exr(tmp_path / "a.exr", image)
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        patched(path, name, struct.pack("<4i", *box))
    start = time.monotonic()
    said = refusal(path)
    assert "more than" in said or "OpenEXR finds its header invalid" in said or "too big for file size" in said
    assert time.monotonic() - start < 5.0


def test_the_true_reason_is_told(tmp_path, image):
    path = write_exr(tmp_path / "a.exr", np.round(image, 1))  # so that it is compressed
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    assert "is truncated or damaged: Preparing to read scanline 0 (chunk 0), found corrupt leader" in refusal(path)
    path.write_bytes(whole[:-100] + bytes(100))
    assert "Unable to decompress" in refusal(path)


def test_a_crash_of_openexr_is_an_error_and_the_next_file_is_read(tmp_path, image, monkeypatch):
    sound = write_exr(tmp_path / "a.exr", image)
    read_latlong(sound)  # starts the process
    server = exr._server._process
    exchange = type(exr._server)._line

    def killed(self, deadline):
        if self._process is server:
            os.kill(server.pid, signal.SIGSEGV)
            server.wait()
        return exchange(self, deadline)

    monkeypatch.setattr(type(exr._server), "_line", killed)
    monkeypatch.setattr(
        os, "read", lambda descriptor, size, read=os.read: b"" if server.poll() else read(descriptor, size)
    )
    assert "is damaged: OpenEXR crashed (SIGSEGV) while reading it" in refusal(sound)
    monkeypatch.undo()
    np.testing.assert_array_equal(read_latlong(sound).image, image)


def test_a_process_that_ended_by_itself_is_started_again(tmp_path, image):
    path = write_exr(tmp_path / "a.exr", image)
    read_latlong(path)
    exr._server._process.stdin.close()
    exr._server._process.wait()
    np.testing.assert_array_equal(read_latlong(path).image, image)


def test_a_file_that_hangs_is_given_up(tmp_path, image, monkeypatch):
    path = write_exr(tmp_path / "a.exr", image)
    read_latlong(path)
    os.kill(exr._server._process.pid, signal.SIGSTOP)
    monkeypatch.setattr(exr, "PATIENCE", 0.3)
    assert "was not read within 0 s" in refusal(path)
    monkeypatch.undo()
    np.testing.assert_array_equal(read_latlong(path).image, image)


def test_without_an_interpreter_it_is_read_here_with_a_warning(tmp_path, image, monkeypatch):
    exr._server.close()
    monkeypatch.setattr(exr, "interpreters", lambda: iter(()))
    path = write_exr(tmp_path / "a.exr", image)
    with pytest.warns(UserWarning, match="read in this process"):
        np.testing.assert_array_equal(read_latlong(path).image, image)


def test_an_interpreter_without_rsibr_is_named(tmp_path, image, monkeypatch):
    exr._server.close()
    path = write_exr(tmp_path / "a.exr", image)
    monkeypatch.setenv(OVERRIDE, "/bin/true")
    with pytest.raises(InputError, match="/bin/true cannot run rsibr"):
        read_latlong(path)


def test_threads_and_forks_read_at_once(tmp_path, rng):
    images = [rng.random((8, 16, 3)).astype(np.float32) for _ in range(8)]
    paths = [write_exr(tmp_path / f"{i}.exr", picture) for i, picture in enumerate(images)]
    read = {}
    threads = [threading.Thread(target=lambda i=i: read.update({i: read_latlong(paths[i]).image})) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for i, picture in enumerate(images):
        np.testing.assert_array_equal(read[i], picture)


def test_a_fork_leaves_the_process_to_its_parent(tmp_path, image):
    code = (
        "import os, sys; from pathlib import Path; from rsibr.scene.latlong import read_latlong\n"
        "from rsibr.scene.panorama.exr import _server\n"
        "path = Path(sys.argv[1]); whole = read_latlong(path).image.sum(); child = os.fork()\n"
        "assert (_server._process is None) == (child == 0)\n"
        "same = [read_latlong(path).image.sum() == whole for _ in range(20)]\n"
        "sys.stdout.write(str(all(same))); sys.stdout.flush()\n"
        "os.waitpid(child, 0) if child else os._exit(0)\n"
    )
    path = write_exr(tmp_path / "a.exr", image)
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "TrueTrue"


def test_the_process_reads_requests_until_stdin_ends(tmp_path, image):
    with subprocess.Popen(
        [sys.executable, "-m", exr_server.__name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout.readline() == f"{exr_server.BEGUN}\n".encode()
        process.stdin.close()
        assert process.wait(timeout=10) == 0

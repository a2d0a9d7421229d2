"""Map files: to the bit, self-describing, and never silently wrong."""

from __future__ import annotations

import errno
import io
import os
import struct
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

from rsibr import backend
from rsibr.errors import BakeError, MachineError
from rsibr.store.map_file import MapFile, decode_map, encode_map, map_channels, read_map, write_map

N = 24
# A rotation without symmetry, so that a transposed or reordered frame cannot pass: Rodrigues' formula about (1, 2, 3).
AXIS = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
CROSS = np.array([[0.0, -AXIS[2], AXIS[1]], [AXIS[2], 0.0, -AXIS[0]], [-AXIS[1], AXIS[0], 0.0]])
FRAME = np.eye(3) + np.sin(0.7) * CROSS + (1.0 - np.cos(0.7)) * CROSS @ CROSS


def sphere_map(variance: bool = True, lobes: tuple[str, ...] = ("radiance",)) -> MapFile:
    random = np.random.default_rng(7)

    def image(*shape: int) -> np.ndarray:
        return random.gamma(0.3, 2.0, (N, N, *shape)).astype(np.float32)

    return MapFile(
        view=FRAME[:, 2],
        frame=FRAME,
        layers={lobe: image(3) for lobe in lobes},
        variance=image(3) if variance else None,
        coverage=image(),
    )


def bits(map_file: MapFile) -> dict[str, bytes]:
    return {name: np.ascontiguousarray(image).tobytes() for name, image in map_file.parts()}


def test_round_trip_keeps_every_bit(tmp_path):
    stored = sphere_map(lobes=("base", "clear coat"))
    hard = np.float32([1e5, 1e30, -1e30, 1e-30, -1e-30, 1e-42, 0.0, -0.0, 65504.0, 65520.0, np.inf, -np.inf, np.nan])
    stored.layers["base"][0, : len(hard), 1] = hard
    stored.variance.view(np.uint32)[3, 4, 2] = 0x7F812345  # a signalling NaN with a payload
    write_map(tmp_path / "a.exr", stored)
    found = read_map(tmp_path / "a.exr")
    assert list(found.layers) == ["base", "clear coat"]
    assert bits(found) == bits(stored)
    assert found.resolution == N
    np.testing.assert_array_equal(found.view, np.float32(stored.view))
    np.testing.assert_array_equal(found.frame, np.float32(stored.frame))


def test_a_sliced_array_is_written_as_it_reads(tmp_path):
    wide = np.random.default_rng(1).random((N, 2 * N, 5)).astype(np.float32)
    stored = MapFile(FRAME[:, 2], FRAME, {"radiance": wide[::-1, ::2, 1:4]}, wide[:, N:, :3], wide[:, ::2, 0])
    write_map(tmp_path / "a.exr", stored)
    assert bits(read_map(tmp_path / "a.exr")) == bits(stored)


def test_headers_tell_a_plain_reader_everything(tmp_path):
    stored = sphere_map(lobes=("base", "coat"))
    write_map(tmp_path / "a.exr", stored)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert [part.name() for part in file.parts] == ["radiance", "base", "coat", "variance", "coverage"]
        assert [sorted(part.channels) for part in file.parts] == [["B", "G", "R"]] * 4 + [["Y"]]
        for part in file.parts:
            assert part.compression() == OpenEXR.ZIP_COMPRESSION
            assert part.type() == OpenEXR.scanlineimage
            assert {channel.pixels.dtype for channel in part.channels.values()} == {np.dtype(np.float32)}
            np.testing.assert_array_equal(part.header["rsibr:view"], np.float32(stored.view))
            np.testing.assert_array_equal(part.header["rsibr:frame"], np.float32(stored.frame))
        np.testing.assert_array_equal(file.parts[0].channels["G"].pixels, stored.radiance[..., 1])
        np.testing.assert_array_equal(file.parts[1].channels["G"].pixels, stored.layers["base"][..., 1])


def test_the_frame_lies_row_by_row_in_the_file():
    data = encode_map(sphere_map())
    view_start = data.index(b"rsibr:view\0v3f\0") + len(b"rsibr:view\0v3f\0") + 4
    frame_start = data.index(b"rsibr:frame\0m33f\0") + len(b"rsibr:frame\0m33f\0") + 4
    assert struct.unpack_from("<3f", data, view_start) == tuple(np.float32(FRAME[:, 2]))
    assert struct.unpack_from("<9f", data, frame_start) == tuple(np.float32(FRAME).ravel())


@pytest.mark.parametrize("variance", [True, False])
def test_mitsuba_shows_the_first_part_upright(tmp_path, variance):
    backend.use()
    stored = sphere_map(variance)
    write_map(tmp_path / "a.exr", stored)
    bitmap = mi.Bitmap(str(tmp_path / "a.exr"))
    assert bitmap.pixel_format() == mi.Bitmap.PixelFormat.RGB
    assert bitmap.component_format() == mi.Struct.Type.Float32
    np.testing.assert_array_equal(np.array(bitmap), stored.layers["radiance"])
    assert (read_map(tmp_path / "a.exr").variance is not None) == variance


def repacked(data: bytes, change) -> bytes:
    """The file with its parts changed in place."""
    with OpenEXR.File(io.BytesIO(data)) as file:
        parts = [
            OpenEXR.Part(dict(p.header), {k: c.pixels for k, c in p.channels.items()}, p.name()) for p in file.parts
        ]
        change(parts)
        stream = io.BytesIO()
        with OpenEXR.File(parts) as changed:
            changed.write(stream)
    return stream.getvalue()


def test_the_first_part_is_the_sum_that_any_program_shows(tmp_path):
    backend.use()
    stored = sphere_map(lobes=("base", "coat", "flakes"))
    write_map(tmp_path / "a.exr", stored)
    np.testing.assert_array_equal(np.array(mi.Bitmap(str(tmp_path / "a.exr"))), stored.radiance)
    expected = np.sum([image.astype(np.float64) for image in stored.layers.values()], axis=0)
    np.testing.assert_allclose(stored.radiance, expected, rtol=1e-6)


def test_a_sum_that_is_not_that_of_the_lobes_is_refused():
    def brighter(parts: list[OpenEXR.Part]) -> None:
        parts[0].channels["RGB"].pixels[3, 4, 1] *= np.float32(1.001)

    data = repacked(encode_map(sphere_map(lobes=("base", "coat"))), brighter)
    with pytest.raises(BakeError, match="radiance is not the sum of its lobes"):
        decode_map(data, "x.exr")


def test_a_map_without_a_sum_as_older_bakes_have_it_is_read():
    stored = sphere_map(lobes=("base", "coat"))
    found = decode_map(repacked(encode_map(stored), lambda parts: parts.pop(0)), "x.exr")
    assert bits(found) == bits(stored)


def test_the_number_of_channels_is_that_of_the_file():
    for count in (1, 2, 5):
        data = encode_map(sphere_map(lobes=tuple(f"lobe{k}" for k in range(count))))
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            assert sum(len(part.channels) for part in file.parts) == map_channels(count)


def test_equal_maps_give_equal_bytes(tmp_path):
    assert write_map(tmp_path / "a.exr", sphere_map()) == write_map(tmp_path / "b.exr", sphere_map())
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_a_truncated_map_is_refused_at_every_length(tmp_path, capfd):
    data = encode_map(sphere_map())
    file = tmp_path / "cut.exr"
    for length in [*range(0, len(data), 97), len(data) - 1]:
        file.write_bytes(data[:length])
        with pytest.raises(BakeError, match=r"cut\.exr"):
            read_map(file)
    assert capfd.readouterr().out == ""  # where --json has its one object


def test_a_flipped_bit_never_gives_another_map(tmp_path):
    stored = sphere_map()
    data = encode_map(stored)
    random = np.random.default_rng(3)
    pixels = data.index(b"chunkCount")
    found = 0
    file = tmp_path / "flipped.exr"
    for offset in [*range(0, pixels, 7), *random.integers(pixels, len(data), 300)]:
        flipped = bytearray(data)
        flipped[offset] ^= 1 << int(random.integers(8))
        file.write_bytes(flipped)
        try:
            read = read_map(file)
        except BakeError:
            found += 1
        else:
            # Left are the bits that say nothing about the map: the software's name, the chromaticities, offset tables.
            assert bits(read) == bits(stored)
            np.testing.assert_array_equal(read.frame, np.float32(stored.frame))
    assert found > 250


@pytest.mark.parametrize("part", [0, 1])
def test_parts_that_disagree_are_refused(tmp_path, part):
    write_map(tmp_path / "a.exr", sphere_map())
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        parts = [
            OpenEXR.Part(dict(p.header), {k: c.pixels for k, c in p.channels.items()}, p.name()) for p in file.parts
        ]
    turned = np.float32(FRAME[:, [1, 2, 0]])
    parts[part].header["rsibr:frame"] = turned
    parts[part].header["rsibr:view"] = np.ascontiguousarray(turned[:, 2])
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "b.exr"))
    with pytest.raises(BakeError, match="altered"):
        read_map(tmp_path / "b.exr")


def test_a_foreign_file_is_refused_by_name(tmp_path):
    (tmp_path / "text.exr").write_text("no picture")
    (tmp_path / "folder.exr").mkdir()
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": np.ones((N, N, 3), np.float32)}) as file:
        file.write(str(tmp_path / "plain.exr"))
    for name in ("text.exr", "folder.exr", "plain.exr", "absent.exr"):
        with pytest.raises(BakeError, match=name.replace(".", r"\.")):
            read_map(tmp_path / name)


@pytest.mark.parametrize(
    "wrong",
    [
        {"layers": {}},
        {"layers": {"variance": np.ones((N, N, 3), np.float32)}},
        {"layers": {"": np.ones((N, N, 3), np.float32)}},
        {"layers": {"radiance": np.ones((N, N, 3), np.float32), "coat": np.ones((N, N, 3), np.float32)}},
        {"layers": {"radiance": np.ones((N, N, 3))}},
        {"layers": {"radiance": np.ones((N, N), np.float32)}},
        {"variance": np.ones((N, N + 1, 3), np.float32)},
        {"coverage": np.ones((N, N), np.float16)},
        {"coverage": np.ones((0, 0), np.float32)},
        {"view": np.array([0.0, 0.0, 1.0])},
        {"view": np.full(3, np.nan)},
        {"frame": FRAME * [1.0, -1.0, 1.0]},
        {"frame": FRAME * 1.01},
        {"frame": np.full((3, 3), np.nan)},
    ],
)
def test_what_is_no_map_cannot_be_made(wrong):
    whole = sphere_map()
    fields = {name: getattr(whole, name) for name in ("view", "frame", "layers", "variance", "coverage")}
    with pytest.raises(ValueError, match=r"."):
        MapFile(**{**fields, **wrong})


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize(("number", "failure"), [(errno.ENOSPC, MachineError), (errno.EROFS, BakeError)])
def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch, call, number, failure):
    file = tmp_path / "a.exr"
    write_map(file, sphere_map())
    before = file.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(failure, match=os.strerror(number)) as raised:
        write_map(file, sphere_map(variance=False))
    assert "\n" not in str(raised.value)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_a_missing_folder_is_said_in_one_line(tmp_path):
    with pytest.raises(BakeError, match=r"nowhere/a\.exr: cannot be written"):
        write_map(Path(tmp_path / "nowhere" / "a.exr"), sphere_map())

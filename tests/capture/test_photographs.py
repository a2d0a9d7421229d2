"""Photographs: bits, orientation and exposure of files that other libraries wrote; every bad file is one clear line."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from rsibr.capture.photographs.exposure import Exposure
from rsibr.capture.photographs.photograph import read_photograph
from rsibr.capture.synthetic.camera_file import write_photograph
from rsibr.errors import InputError, MachineError
from tests.scene.maps import write_exr


@pytest.fixture
def picture(rng):
    return rng.integers(0, 256, (4, 6, 3)).astype(np.uint8)


@pytest.mark.parametrize("ending", ["png", "tif"])
@pytest.mark.parametrize("bits", [8, 16])
def test_integers_become_shares_of_the_largest(tmp_path, rng, ending, bits):
    largest = 2**bits - 1
    stored = rng.integers(0, largest + 1, (4, 6, 3)).astype(np.uint8 if bits == 8 else np.uint16)
    path = tmp_path / f"one.{ending}"
    cv2.imwrite(str(path), stored[..., ::-1])
    found = read_photograph(path)
    assert found.levels == largest
    assert not found.is_linear
    assert found.size == (6, 4)
    assert np.array_equal(np.rint(found.values * largest), stored)


def test_grey_and_alpha(tmp_path, picture):
    grey, with_alpha = tmp_path / "grey.png", tmp_path / "alpha.png"
    Image.fromarray(picture[..., 0]).save(grey)
    Image.fromarray(np.dstack([picture, picture[..., :1]])).save(with_alpha)
    assert np.array_equal(read_photograph(grey).values[..., 2] * 255, picture[..., 0])
    assert np.array_equal(np.rint(read_photograph(with_alpha).values * 255), picture)


def test_a_linear_file_is_taken_as_it_is(tmp_path, rng):
    image = rng.random((4, 6, 3), dtype=np.float32) * 100
    write_exr(tmp_path / "one.exr", image)
    found = read_photograph(tmp_path / "one.exr")
    assert found.is_linear
    assert found.levels == 0
    assert np.array_equal(found.values, image)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_upright_as_pillow_turns_it(tmp_path, picture, orientation):
    path, tags = tmp_path / "one.png", Image.Exif()
    tags[0x0112] = orientation
    Image.fromarray(picture).save(path, exif=tags)
    from PIL import ImageOps

    expected = np.asarray(ImageOps.exif_transpose(Image.open(path)))
    assert np.array_equal(np.rint(read_photograph(path).values * 255), expected)


def test_exposure_of_exif(tmp_path, picture):
    path = tmp_path / "one.png"
    write_photograph(path, picture, Exposure(1 / 250, 5.6, 400))
    found = read_photograph(path).exposure
    assert found is not None
    assert [*found.to_record().values()] == pytest.approx([1 / 250, 5.6, 400])
    write_photograph(path, picture)
    assert read_photograph(path).exposure is None


def test_exposure_of_a_jpeg_by_another_writer(tmp_path, picture):
    from PIL.TiffImagePlugin import IFDRational

    tags = Image.Exif()
    tags[0x8769] = {33434: IFDRational(1, 60), 34855: (200, 100)}
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "jpeg", exif=tags)
    (tmp_path / "one.jpg").write_bytes(stream.getvalue())
    found = read_photograph(tmp_path / "one.jpg").exposure
    assert found is not None
    assert found.seconds == pytest.approx(1 / 60)


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n" + b"\0" * 40])
def test_what_is_no_picture_is_one_clear_line(tmp_path, content):
    (tmp_path / "one.png").write_bytes(content)
    with pytest.raises(InputError, match=r"one.png: is no picture that can be decoded"):
        read_photograph(tmp_path / "one.png")


def test_nothing_and_a_folder(tmp_path):
    with pytest.raises(InputError, match="no such photograph"):
        read_photograph(tmp_path / "one.png")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match="folder"):
        read_photograph(tmp_path / "folder.png")


def test_a_raw_file_without_the_package_says_what_to_install(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "rawpy", None)
    (tmp_path / "one.dng").write_bytes(b"II*\0")
    with pytest.raises(MachineError, match=r"rsibr\[raw\]"):
        read_photograph(tmp_path / "one.dng")


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), float("inf")])
def test_an_exposure_is_positive(wrong):
    with pytest.raises(InputError, match="positive"):
        Exposure(wrong)


@pytest.mark.parametrize("bits", [8, 16])
def test_a_written_photograph_holds_pixels_and_exposure(tmp_path, rng, bits):
    stored = rng.integers(0, 2**bits, (4, 6, 3)).astype(np.uint8 if bits == 8 else np.uint16)
    write_photograph(tmp_path / "one.png", stored, Exposure(1 / 250, 5.6, 400))
    found = read_photograph(tmp_path / "one.png")
    assert found.exposure is not None
    assert [*found.exposure.to_record().values()] == pytest.approx([1 / 250, 5.6, 400])
    assert np.array_equal(np.rint(found.values * found.levels), stored)
    Image.open(tmp_path / "one.png").verify()  # the sums of all chunks


def _jpeg(picture, **options):
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "jpeg", **options)
    return stream.getvalue()


@pytest.fixture
def large(rng):
    return cv2.GaussianBlur(rng.integers(0, 256, (64, 96, 3)).astype(np.uint8), (0, 0), 2)


@pytest.mark.parametrize("progressive", [False, True])
def test_a_sound_jpeg_is_read_whatever_follows_its_end(tmp_path, large, progressive):
    data = _jpeg(large, progressive=progressive)
    for content in (data, data + b"what a telephone appends"):
        (tmp_path / "one.jpg").write_bytes(content)
        expected = np.asarray(Image.open(io.BytesIO(data)))
        assert np.abs(read_photograph(tmp_path / "one.jpg").values * 255 - expected).max() <= 3


@pytest.mark.parametrize("progressive", [False, True])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.999])
def test_a_jpeg_without_its_end_is_refused(tmp_path, large, share, progressive):
    thumbnail = Image.Exif()
    thumbnail[0x010E] = "\xff\xd9"  # an end marker in the header is none of the picture
    data = _jpeg(large, progressive=progressive, exif=thumbnail)
    (tmp_path / "one.jpg").write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"one.jpg: is cut short"):
        read_photograph(tmp_path / "one.jpg")


def test_a_jpeg_whose_decoder_warns_is_refused(tmp_path, large, capfd):
    data = _jpeg(large)
    middle = (data.index(b"\xff\xda") + len(data)) // 2
    (tmp_path / "one.jpg").write_bytes(data[:middle] + data[-2:])  # half the blocks, and an end marker
    with pytest.raises(InputError, match=r"one.jpg: is damaged: Corrupt JPEG data"):
        read_photograph(tmp_path / "one.jpg")
    assert capfd.readouterr().err == ""

"""Files of pictures, read back by other libraries."""

from __future__ import annotations

import json

import numpy as np
import OpenEXR
import pytest
from matplotlib.image import imread

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.pictures.picture import NormalCounts, Picture
from rsibr.shading.pictures.picture_file import Origin, exposure_of_pictures, on_black, write_picture

SRGB_HALF = 188  # of linear 0.5, IEC 61966-2-1


def picture(height=3, width=5, radiance=0.5, alpha=1.0):
    rng = np.random.default_rng(1)
    shape = height, width
    return Picture(
        radiance=np.full((*shape, 3), radiance, np.float32),
        alpha=np.full(shape, alpha, np.float32),
        depth=rng.random(shape, np.float32),
        normal=rng.random((*shape, 3), np.float32),
        counts=NormalCounts(1, 0, 0, 0, 0),
    )


def test_an_exr_holds_every_layer_bit_by_bit(tmp_path):
    made = picture()
    made.radiance[1, 2] = 1e5, 0.25, 1e-6
    made.depth[0, 0] = np.inf
    write_picture(made, tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        layers = {name: channel.pixels for name, channel in file.channels().items()}
        assert len(file.parts) == 1
    assert set(layers) == {"R", "G", "B", "A", "depth.Z", "normal.X", "normal.Y", "normal.Z"}
    assert all(layer.dtype == np.float32 for layer in layers.values())
    np.testing.assert_array_equal(np.stack([layers[c] for c in "RGB"], -1), made.radiance)
    np.testing.assert_array_equal(layers["A"], made.alpha)
    np.testing.assert_array_equal(layers["depth.Z"], made.depth)
    np.testing.assert_array_equal(np.stack([layers[f"normal.{c}"] for c in "XYZ"], -1), made.normal)


def test_the_header_takes_points_of_the_world_into_the_camera(tmp_path):
    camera = Camera.look_at((3, 1, 4), (1, 0, 0), width=5, height=3)
    write_picture(picture(), tmp_path / "a.exr", origin=Origin(camera, {"*": "paint"}, {"*": "rsibr"}, {"rays": 4}))
    with OpenEXR.File(str(tmp_path / "a.exr"), header_only=True) as file:
        header = dict(file.header())
        matrix = np.array(header["worldToCamera"], np.float64)
    np.testing.assert_allclose([3, 1, 4, 1] @ matrix, [0, 0, 0, 1], atol=1e-5)
    np.testing.assert_allclose([1, 0, 0, 1] @ matrix, [0, 0, -np.sqrt(21), 1], atol=1e-5)
    assert json.loads(header["rsibr:camera"])["resolution"] == [5, 3]
    assert json.loads(header["rsibr:methods"]) == {"*": "rsibr"}
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION


def test_a_png_has_straight_alpha_and_the_curve_of_srgb(tmp_path):
    write_picture(picture(radiance=0.25, alpha=0.5), tmp_path / "a.png", exposure=1.0)
    rgba = np.rint(imread(tmp_path / "a.png") * 255)
    np.testing.assert_array_equal(rgba, np.broadcast_to([SRGB_HALF, SRGB_HALF, SRGB_HALF, 128], rgba.shape))


def test_a_film_shows_what_is_half_covered_over_black():
    np.testing.assert_array_equal(on_black(picture(radiance=0.5, alpha=0.5), 1.0)[0, 0], [188, 188, 188, 255])


def test_the_exposure_is_chosen_from_the_surfaces_alone():
    made = picture(radiance=2.0)
    made.radiance[0], made.alpha[0] = 0, 0
    assert exposure_of_pictures([made]) == pytest.approx(0.8 / 2)
    assert exposure_of_pictures([picture(radiance=0.0)]) == 1.0
    assert exposure_of_pictures([picture(alpha=0.0)]) == 1.0


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.exr.gz", ".png"])
def test_other_endings_are_refused(tmp_path, name):
    with pytest.raises(InputError, match="ending"):
        write_picture(picture(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_the_ending_counts_in_upper_case_too(tmp_path):
    write_picture(picture(), tmp_path / "a.PNG")
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")

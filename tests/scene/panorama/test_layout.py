"""OpenEXR's layouts against its own formulas, written out texel by texel as in ImfEnvmap.cpp."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

from rsibr.errors import InputError
from rsibr.geometry.projections.projection import projection
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.panorama.layout import aspect_notes, without_seam
from rsibr.scene.panorama.resampled import sheets_of, to_latlong
from tests.scene.maps import BLOBS, latlong_directions, write_channels


def light(directions):
    """Smooth radiance (…, 3) that shows every turn and mirroring: a light at each of `BLOBS`."""
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    blobs = [np.exp(4.0 * (directions @ np.array(axis) - 1.0))[..., None] * rgb for axis, rgb in BLOBS.items()]
    return 0.05 + np.sum(blobs, axis=0)


def cube(side):
    """Fill `CubeMap::direction` into the pixels of `CubeMap::pixelPosition`."""
    image = np.zeros((6 * side, side, 3))
    last = side - 1
    for face in range(6):
        for i in range(side):
            for j in range(side):
                p, q = (2.0 * i / last - 1.0, 2.0 * j / last - 1.0)
                sign = -1.0 if face % 2 else 1.0
                direction = [(sign, p, q), (p, sign, q), (p, q, sign)][face // 2]
                x, y = [
                    (j, last - i), (last - j, last - i), (i, last - j), (i, j), (last - i, last - j), (i, last - j)
                ][face]  # fmt: skip
                image[face * side + y, x] = light(np.array(direction))
    return image


def from_cube(image, most_texels, where):
    """Latitude–longitude map of OpenEXR's cube, faces one below the other."""
    of = projection("cube-openexr")
    sheets, layout = sheets_of(image, of, where)
    assert layout == "column"
    return to_latlong(sheets, of, most_texels, where)


def test_a_cube_shows_its_light_in_every_direction():
    image = from_cube(cube(33).astype(np.float32), 2**20, "")
    assert image.shape == (129, 256, 3)
    expected = light(latlong_directions(129, 256))
    assert np.abs(image - expected).max() < 0.005 * expected.max()


def test_a_cube_file_lights_the_scene_where_openexr_says(tmp_path):
    pixels = cube(33).astype(np.float32)
    path = write_channels(tmp_path / "cube.exr", {"RGB": pixels}, envmap=OpenEXR.ENVMAP_CUBE)
    environment = load_environment(EnvironmentConfig(file=path, rotation_deg=90.0))
    directions = np.random.default_rng(3).normal(size=(300, 3))
    seen = radiance(environment, directions)
    unturned = directions @ np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # +Z turns to +X
    np.testing.assert_allclose(seen, light(unturned), atol=0.01 * seen.max())
    assert "cube was converted to 256 × 129" in environment.notes[0]


def test_the_energy_of_a_single_texel_of_a_cube_stays():
    """Solid angle of the texel's tent at a corner, where the map is coarsest against the cube, within 3 %."""
    side, expected = 17, 0.0
    pixels = np.zeros((6 * side, side, 3), np.float32)
    pixels[1, 1] = 1.0  # next to a corner of +X
    samples = 200
    offsets = (np.arange(2 * samples) + 0.5) / samples - 1.0
    u, v = np.meshgrid(-1.0 + (1.0 + offsets) * 2.0 / (side - 1), 1.0 - (1.0 + offsets) * 2.0 / (side - 1))
    tent = np.outer(1.0 - np.abs(offsets), 1.0 - np.abs(offsets))
    expected = (tent / (1.0 + u**2 + v**2) ** 1.5).sum() * (2.0 / (side - 1) / samples) ** 2
    image = from_cube(pixels, 2**20, "")[..., 0]
    polar = np.pi * np.arange(len(image)) / (len(image) - 1)
    weights = np.sin(polar) * np.pi / (len(image) - 1) * 2.0 * np.pi / image.shape[1]
    assert (image.sum(axis=1) * weights).sum() == pytest.approx(expected, rel=0.03)


def test_faces_of_one_texel_are_constant():
    faces = np.arange(18, dtype=np.float32).reshape(6, 1, 3)
    image = from_cube(faces, 2**20, "")
    middle = len(image) // 2
    np.testing.assert_allclose(image[0, 0], faces[2, 0], rtol=1e-6)
    np.testing.assert_allclose(image[-1, 0], faces[3, 0], rtol=1e-6)
    of_columns = [5, 0, 0, 4, 4, 1, 1, 5]
    np.testing.assert_allclose(image[middle], faces[of_columns, 0], rtol=1e-6)


def test_a_cube_of_another_shape_or_too_large_is_refused():
    with pytest.raises(InputError, match=r"8 × 47 texels are no 'cube-openexr'\. Save .* 6:1 \(row\), 1:6"):
        from_cube(np.zeros((47, 8, 3), np.float32), 2**20, "sky")
    with pytest.raises(InputError, match="more than 100"):
        from_cube(np.zeros((48, 8, 3), np.float32), 100, "sky")


def test_a_latlong_attribute_puts_texels_where_openexr_says(tmp_path):
    """Each texel of the file, in the direction of `LatLongMap::direction`, comes back as it is stored."""
    height, width = 9, 17
    image = np.random.default_rng(4).random((height, width, 3)).astype(np.float32)
    image[:, -1] = image[:, 0]
    path = write_channels(tmp_path / "sky.exr", {"RGB": image}, envmap=OpenEXR.ENVMAP_LATLONG)
    latitude = -np.pi * (np.arange(height) / (height - 1) - 0.5)[1:-1, None]
    longitude = -2.0 * np.pi * (np.arange(width) / (width - 1) - 0.5)[None, :]
    parts = [
        np.sin(longitude) * np.cos(latitude),
        np.sin(latitude) + 0 * longitude,
        np.cos(longitude) * np.cos(latitude),
    ]
    directions = np.stack(parts, axis=-1).reshape(-1, 3)
    environment = load_environment(EnvironmentConfig(file=path))
    np.testing.assert_allclose(radiance(environment, directions), image[1:-1].reshape(-1, 3), atol=2e-4)
    assert environment.frame is not None
    plain = load_environment(EnvironmentConfig(file=write_channels(tmp_path / "plain.exr", {"RGB": image})))
    assert np.abs(radiance(plain, directions) - image[1:-1].reshape(-1, 3)).max() > 0.1


def test_the_columns_of_the_seam_become_their_mean():
    image, turn = without_seam(np.array([[[1.0] * 3, [2.0] * 3, [3.0] * 3]], np.float32))
    np.testing.assert_array_equal(image[0, :, 0], [2.0, 2.0])
    assert turn == pytest.approx(np.pi / 2)
    single = np.ones((4, 1, 3), np.float32)
    assert without_seam(single) == (single, 0.0)


@pytest.mark.parametrize(("height", "width", "word"), [(48, 48, "probe"), (64, 48, "vertical cross"),
    (48, 64, "horizontal cross"), (16, 96, "strip"), (96, 16, "strip"), (999, 1000, "probe")])  # fmt: skip
def test_other_layouts_are_told_by_their_aspect(height, width, word):
    (note,) = aspect_notes(height, width)
    assert word in note
    assert f"{width} × {height}" in note


@pytest.mark.parametrize("shape", [(512, 1024), (257, 512), (32, 65), (1, 1), (1, 7), (100, 300)])
def test_usual_aspects_need_no_note(shape):
    assert aspect_notes(*shape) == ()


def radiance(environment, directions):
    (emitter,) = mi.load_dict({"type": "scene", "emitter": environment.emitter()}).emitters()
    si = dr.zeros(mi.SurfaceInteraction3f, len(directions))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    si.wi = -mi.Vector3f(directions.astype(np.float32).T)
    return np.array(emitter.eval(si)).T

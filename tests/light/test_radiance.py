"""The picture of the light: all of its energy, where it belongs, for every kind of emitter."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.light.radiance import light_map
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from tests.arrays import to_numpy
from tests.scene.maps import BLOBS

SMALL = 64


def radiance(emitter, resolution=SMALL, width=0):
    """Texels of the picture, (R², 3) of float64."""
    return light_map(emitter, width, resolution).reshape(-1, 3).astype(np.float64)


def directions(resolution=SMALL):
    return to_numpy(texel_directions(resolution)).T


@pytest.mark.parametrize("colour", [0.0, 2.5, [0.5, 1.0, 4.0]])
def test_a_constant_emitter_is_constant(colour):
    picture = light_map({"type": "constant", "radiance": {"type": "rgb", "value": colour}}, resolution=SMALL)
    assert picture.shape == (SMALL, SMALL, 3)
    assert np.array_equal(picture, np.broadcast_to(np.float32(colour), picture.shape))


def with_a_sun(width, row, column, size):
    """A square of so many texels a side; its top left texel is given."""
    image = np.full((width // 2, width, 3), 1e-2, dtype=np.float32)
    image[row : row + size, column : column + size] = 1e6
    return {"type": "envmap", "bitmap": mi.Bitmap(image)}


@pytest.mark.parametrize(
    ("width", "row", "column", "size", "tolerance"),
    [
        (1024, 256, 300, 1, 0.003),
        pytest.param(4096, 1100, 777, 1, 0.025, marks=pytest.mark.slow),
        pytest.param(4096, 1100, 777, 4, 0.003, marks=pytest.mark.slow),  # a sun of 0.35°, less than ours
    ],
)
def test_a_light_smaller_than_a_texel_keeps_its_energy_and_place(width, row, column, size, tolerance):
    """A sun of 1e6 over a sky of 1e-2, in maps as fine as the picture and four times finer; rows lie on j/(H−1)."""
    polar = np.pi * (row + np.arange(size)) / (width // 2 - 1)
    exact = 1e6 * size * np.sin(polar).sum() * (2 * np.pi / width) * (np.pi / (width // 2 - 1))
    picture = light_map(with_a_sun(width, row, column, size), width).reshape(-1, 3).astype(np.float64)
    sun = (picture - 1e-2) * texel_solid_angles(512)[:, None]
    assert sun.sum(axis=0) == pytest.approx([exact] * 3, rel=tolerance)
    middle = (sun[:, :1] * directions(512)).sum(axis=0) / sun[:, 0].sum()
    polar, azimuth = polar.mean(), 2 * np.pi * (column + 0.5 * size) / width
    toward = [np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)]
    assert np.linalg.norm(middle - toward) < 3e-3  # less than half a texel


@pytest.mark.parametrize("turn", [0, 90, 37])
def test_lights_lie_where_the_environment_has_them(asymmetric_environment, turn):
    """Against the formula of the map, turned about +Y."""
    environment = load_environment(EnvironmentConfig(file=asymmetric_environment, rotation_deg=turn))
    s, c = np.sin(np.radians(turn)), np.cos(np.radians(turn))
    turned = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    expected = np.full((SMALL**2, 3), 0.05)
    for axis, colour in BLOBS.items():
        expected += np.exp(20 * (directions() @ (turned @ axis) - 1))[:, None] * colour
    # Both the map's texels and the picture's are 3° wide, a light 13°: 5 % at a peak
    assert np.abs(radiance(environment.emitter()) - expected).max() < 0.06 * expected.max()
    assert np.abs(radiance(environment.emitter()) - expected).mean() < 0.01 * expected.mean()


def test_a_turn_keeps_the_energy(asymmetric_environment):
    angles = texel_solid_angles(SMALL)
    energies = [
        angles @ radiance(load_environment(EnvironmentConfig(file=asymmetric_environment, rotation_deg=turn)).emitter())
        for turn in (0, 33, 90, 200)
    ]
    assert np.ptp(energies, axis=0).max() < 2e-3 * np.mean(energies)


def test_an_emitter_without_a_picture_is_black():
    assert not light_map({"type": "directional", "direction": [0, -1, 0]}, resolution=8).any()


def test_sun_and_sky_are_finite_and_bright_where_the_sun_is():
    sun = np.array([0.48, 0.6, 0.64])
    picture = radiance({"type": "sunsky", "sun_direction": sun.tolist(), "sun_aperture": 8.0})
    assert np.isfinite(picture).all()
    assert picture.min() >= 0
    assert directions()[picture.sum(axis=1).argmax()] @ sun > np.cos(np.radians(4 + 3))  # the aperture's half, a texel

"""Draws from emitters: sources that a grid of sample points misses keep their power and their place."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.light.emitter_draws import MOST_DELTA_LIGHTS, EmitterDraws
from rsibr.light.radiance import light_map
from tests.arrays import to_numpy, unit_vectors

Z = 5.5
"""Standard errors: two-sided false-alarm rate 3.8e-8 a channel, 9e-7 for the 24 channels of the test."""

GRID = 2.5e-3
"""Relative error of sample points on a grid in a sky with a horizon, in the limit of many random numbers."""

DRAWS = 2**19


def scene(emitter):
    return mi.load_dict({"type": "scene", "light": emitter})


def power(emitter, seed):
    """Integral of the radiance over the sphere with its standard error, by independent draws of the emitter."""
    u = mi.Point2f(np.random.default_rng(seed).random((2, DRAWS), dtype=np.float32))
    _, weight = scene(emitter).sample_emitter_direction(dr.zeros(mi.Interaction3f, DRAWS), u, False)
    weights = np.array(weight, dtype=np.float64)
    return weights.mean(axis=1), weights.std(axis=1) / np.sqrt(DRAWS)


def sun(elevation_deg, **parameters):
    """Sun and sky, +Z up."""
    elevation = np.radians(elevation_deg)
    toward = [float(np.cos(elevation)) * 0.8, float(np.cos(elevation)) * -0.6, float(np.sin(elevation))]
    return {"type": "sunsky", "sun_direction": toward, **parameters}


@pytest.mark.parametrize(
    "emitter",
    [
        sun(2),
        sun(5, turbidity=8.0),
        sun(30),
        sun(75, sky_scale=0.0),
        sun(30, sun_aperture=0.05),
        sun(30, sun_aperture=2.0),
        sun(30, sun_aperture=10.0, turbidity=1.5),
        sun(20, sun_scale=0.0),
    ],
)
def test_the_picture_of_sun_and_sky_holds_what_sampling_finds(emitter):
    """A statistical test; 20 sample points in the sun's disc alone err by 5 %, and see none of 0.05°."""
    sampled, error = power(emitter, 3)
    held = texel_solid_angles(512) @ light_map(emitter).reshape(-1, 3).astype(np.float64)
    assert np.all(np.abs(held - sampled) < Z * error + GRID * np.abs(sampled))


def test_the_sun_lies_where_it_is():
    emitter = sun(40, sky_scale=0.0)
    picture = light_map(emitter).reshape(-1, 3)[:, 0].astype(np.float64) * texel_solid_angles(512)
    middle = to_numpy(texel_directions(512)) @ picture / picture.sum()
    assert np.linalg.norm(middle - emitter["sun_direction"]) < 2e-3  # half a texel is 3.5e-3


@pytest.mark.parametrize(("width", "row"), [(1024, 1), (1024, 300)])
def test_a_lamp_of_one_texel_keeps_its_power_also_beside_a_pole(width, row):
    """There a texel of the map is a sliver that a grid may hit twice or not at all."""
    image = np.zeros((width // 2, width, 3), np.float32)
    image[row, 300] = [1e4, 1e5, 1e6]
    step, polar = np.pi / (width // 2 - 1), np.pi * row / (width // 2 - 1)
    exact = np.array([1e4, 1e5, 1e6]) * (2 * np.pi / width) * np.sin(polar) * 2 * (1 - np.cos(step)) / step
    picture = light_map({"type": "envmap", "bitmap": mi.Bitmap(image)}, width).reshape(-1, 3).astype(np.float64)
    assert texel_solid_angles(512) @ picture == pytest.approx(exact, rel=0.01)


def test_a_directional_light_is_one_delta_light_and_no_picture():
    beam = {"type": "directional", "direction": [0, -2, -1], "irradiance": {"type": "rgb", "value": [3, 2, 1]}}
    found = EmitterDraws.of(scene(beam)).delta_lights()
    assert found.directions == pytest.approx(np.array([[0, 2, 1]]) / np.sqrt(5), abs=1e-6)
    assert found.irradiance == pytest.approx(np.array([[3, 2, 1]]), rel=1e-6)
    assert not light_map(beam, resolution=16).any()


def draws(directions, probability):
    """As many draws of each direction as its probability says, each of irradiance 1, 2, 3, … in red."""
    of = np.repeat(np.arange(len(directions)), (np.array(probability) * 1000).astype(int))
    weights = np.zeros((len(of), 3))
    weights[:, 0] = (1 + of) / np.array(probability)[of]
    return EmitterDraws(directions[of], weights, np.array(probability)[of], np.ones(len(of), bool))


def test_several_delta_lights_are_told_apart(rng):
    directions = unit_vectors(rng, 3)
    found = draws(directions, [0.5, 0.2, 0.3]).delta_lights()
    assert found.directions == pytest.approx(directions, abs=1e-6)
    assert found.irradiance[:, 0] == pytest.approx([1, 2, 3], rel=1e-6)


def test_too_many_delta_lights_are_refused(rng):
    count = MOST_DELTA_LIGHTS + 1
    with pytest.raises(InputError, match="more than 64 lights without extent"):
        draws(unit_vectors(rng, count), np.full(count, 1 / count)).delta_lights()

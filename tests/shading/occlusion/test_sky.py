"""The split of the environment keeps its irradiance, small sources and lights without extent included."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light
from rsibr.shading.occlusion.gathering import Places, gathered
from rsibr.shading.occlusion.sky import MOST_SOURCES, Sky
from tests.shading.occlusion.objects import scene_of, torus


def sunny(resolution=64):
    """A gradient with a sun of a few texels and another lamp."""
    d = np.array(texel_directions(resolution), np.float64).T
    sky = 1 + d @ [0.3, 0.5, 0.1]
    sun = 400.0 * (d @ [0.36, 0.8, 0.48] > 0.999) + 30.0 * (d @ [0.0, -0.6, 0.8] > 0.98)
    colour = sky[:, None] * [1, 0.9, 0.8] + sun[:, None] * [1, 0.8, 0.5]
    return colour.reshape(resolution, resolution, 3).astype(np.float32)


def test_open_irradiance_is_that_of_the_picture(rng):
    picture = sunny()
    delta = DeltaLights(np.array([[0.0, 0.0, 1.0]], np.float32), np.array([[2.0, 1.0, 0.5]], np.float32))
    sky = Sky.of(Light(picture, delta=delta))
    assert 1 < int(sky.count[0]) <= MOST_SOURCES + 1
    n = rng.normal(size=(50, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    far = scene_of(torus=torus())
    found = gathered(far.geometry, Places.of((100 * n).astype(np.float32), n.astype(np.float32), 1e-4), sky, 1024)
    d, solid = np.array(texel_directions(64), np.float64).T, texel_solid_angles(64)
    expected = np.einsum("nt,tc->nc", np.maximum(n @ d.T, 0), picture.reshape(-1, 3) * solid[:, None])
    expected += np.maximum(n[:, 2:], 0) * [2.0, 1.0, 0.5]
    assert np.allclose(found.open, expected, rtol=0.03)
    assert np.abs(found.open / expected - 1).mean() < 0.01


@pytest.mark.parametrize("radiance", [0.0, 2.0])
def test_an_even_sky_has_no_source(radiance):
    sky = Sky.of(Light(np.full((16, 16, 3), radiance, np.float32)))
    assert int(sky.count[0]) == 0
    assert np.allclose(np.array(sky.even.fetch(mi.Vector3f(0, 1, 0), mi.UInt32(0))), radiance, rtol=1e-2)

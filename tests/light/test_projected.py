"""The light of a bake in any projection: its energy, its place, and lights without extent."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.octahedral import texel_directions as octahedral_directions
from rsibr.geometry.projections.octahedral import texel_solid_angles as octahedral_angles
from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import SphereImage, texel_directions, texel_solid_angles
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.projected import light_in
from rsibr.light.radiance import Light
from rsibr.methods.frozen import Frozen
from tests.arrays import to_numpy

NAMES = ["cube", "latlong", "polar", "octahedral", "dual-paraboloid", "mirror-ball"]
SIDE = 64


def lamps():
    """A dim sky with six lamps of a few texels, each in a direction of its own."""
    picture = np.full((SIDE, SIDE, 3), 0.1, np.float32)
    for place in np.random.default_rng(2).integers(0, SIDE - 3, (6, 2)):
        picture[place[0] : place[0] + 2, place[1] : place[1] + 3] += np.float32(50.0)
    return Light(picture)


@pytest.mark.parametrize("name", NAMES)
def test_the_energy_of_lamps_stays(name):
    """Texels of a table are some 5 times as wide as the lamps: their means hold all of it, within 3 %."""
    light = lamps()
    whole = octahedral_angles(SIDE) @ light.picture.reshape(-1, 3)
    table = light_in(light, projection(name), 12)
    held = (texel_solid_angles(projection(name), 12)[..., None] * table).sum(axis=(0, 1, 2))
    assert held == pytest.approx(whole, rel=0.03)


@pytest.mark.parametrize("name", ["cube", "polar", "dual-paraboloid"])
def test_the_energy_of_a_single_texel_stays(name):
    """Within 4 %, at a vertex and an edge of the octahedron, where its tent bends, and anywhere."""
    side, one = 128, projection(name)
    for row, column in [(64, 64), (32, 32), (17, 101), (90, 40)]:
        picture = np.zeros((side, side, 3), np.float32)
        picture[row, column] = 1.0
        held = (texel_solid_angles(one, 16)[..., None] * light_in(Light(picture), one, 16)).sum(axis=(0, 1, 2))
        assert held == pytest.approx(octahedral_angles(side)[row * side + column], rel=0.04)


@pytest.mark.parametrize("name", NAMES)
def test_a_lamp_is_where_it_was(name):
    picture = np.zeros((SIDE, SIDE, 3), np.float32)
    picture[40:42, 11:13] = 1.0
    (towards,) = to_numpy(octahedral_directions(SIDE)).T.reshape(SIDE, SIDE, 3)[40:41, 11]
    table = light_in(Light(picture), projection(name), 24).reshape(-1, 3)
    weight = texel_solid_angles(projection(name), 24).reshape(-1, 1) * table[:, :1]
    mean = (weight * to_numpy(texel_directions(projection(name), 24)).T).sum(axis=0)
    assert mean @ towards / np.linalg.norm(mean) > np.cos(0.1)


@pytest.mark.parametrize("name", NAMES)
def test_a_light_without_extent_adds_its_irradiance(name):
    direction = np.array([[0.6, 0.64, -0.48]], np.float32)
    delta = DeltaLights(direction, np.array([[3.0, 2.0, 1.0]], np.float32))
    light = Light(np.full((16, 16, 3), 0.5, np.float32), delta=delta)
    one = projection(name)
    added = light_in(light, one, 9, delta=True) - light_in(light, one, 9)
    assert np.count_nonzero(added[..., 0]) == 1
    assert (texel_solid_angles(one, 9)[..., None] * added).sum(axis=(0, 1, 2)) == pytest.approx([3, 2, 1], rel=1e-4)
    lit = np.argmax(added[..., 0])
    assert to_numpy(texel_directions(one, 9)).T[lit] @ direction[0] > np.cos(0.4)


def test_a_texture_is_an_argument_of_recorded_kernels():
    """Other values and another size of the sheets need no new recording."""
    look_up = Frozen(lambda texture, d: texture.lookup(d))
    d = dr.normalize(mi.Vector3f(np.random.default_rng(1).normal(size=(3, 50)).astype(np.float32)))
    for side in (8, 8, 12):
        image = SphereImage(projection("cube"), np.random.default_rng(side).random((6, side, side, 3)))
        assert np.array_equal(to_numpy(look_up(image.texture, d)), to_numpy(image.lookup(d)))
    assert look_up.recordings == 1

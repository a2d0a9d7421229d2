"""A projection in axes of its own: directions turn, texels stay."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.projection import projection, projection_names
from rsibr.geometry.projections.sphere_image import SphereImage, converted, texel_directions
from rsibr.geometry.projections.turned import Turned

FRAME = view_frame([0.3, -0.5, 0.8])


@pytest.mark.parametrize("name", projection_names())
def test_directions_are_turned_and_found_again(name):
    inner = projection(name)
    turned = Turned(inner, FRAME)
    d = np.array(texel_directions(turned, 8), float)
    np.testing.assert_allclose(d, FRAME @ np.array(texel_directions(inner, 8), float), atol=1e-6)
    axes = turned.axes(8)
    assert axes == inner.axes(8)
    np.testing.assert_array_equal(turned.solid_angles(*axes), inner.solid_angles(*axes))
    if inner.covers_sphere:
        random = np.random.default_rng(5).normal(size=(3, 100))
        random /= np.linalg.norm(random, axis=0)
        again = turned.direction(*turned.place(mi.Vector3f(random.astype(np.float32))))
        np.testing.assert_allclose(np.array(again), random, atol=1e-5)


def test_a_linear_field_of_the_world_stays_itself():
    """Components of a direction, on a mirror ball seen from anywhere, are those of that direction on a cube."""
    ball = Turned(projection("mirror-ball"), FRAME)
    values = np.array(texel_directions(ball, 128)).T.reshape(1, 128, 128, 3)
    cube = converted(SphereImage(ball, values), projection("cube"), 16).values
    d = np.array(texel_directions(projection("cube"), 16)).T.reshape(6, 16, 16, 3)
    far = d @ -FRAME[:, 2] < 0.9  # −v is where a ball has no texels
    np.testing.assert_allclose(cube[far], d[far], atol=0.02)

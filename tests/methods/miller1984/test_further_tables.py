"""Backscatter and refraction tables of section 9."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.methods.miller1984.further_tables import backscatter, refracted_direction, refraction
from rsibr.methods.registry import method_names, registration
from tests.methods.miller1984.scene import inputs, light, matte, one_light, sky
from tests.methods.miller1984.test_method import miller1984, pairs, radiance, vectors
from tests.methods.scene import image, inside, normals


def test_they_are_registered_and_not_listed():
    for name in ("miller1984-backscatter", "miller1984-refraction", "miller1984-isotropic"):
        assert registration(name).sees_delta_lights
        assert name not in method_names()


def test_backscatter_is_looked_up_in_the_viewing_direction(rng):
    """A light behind the viewer: k_s E (E·L)ⁿ/4π whatever the normal, beside what the surface reflects itself."""
    direction = np.array([0.6, 0.0, 0.8])
    lit = inputs(one_light(direction, [1, 1, 1]), matte(0.5, 0.5, 0.5))
    n, v = pairs(rng, 300)
    own = radiance(miller1984(lit, illumination_rows=504), n, v)
    found = radiance(backscatter(lit, albedo=0.3, n_b=30.0, illumination_rows=504), n, v) - own
    closed = 0.3 * 62 * np.maximum(v @ direction, 0) ** 30 / (4 * np.pi)
    assert np.abs(found - closed[:, None]).max() < 0.03 * closed.max()


def test_backscatter_of_a_constant_sky_is_its_albedo(rng):
    lit = inputs(light(lambda d: np.ones((len(d), 3)), 64), matte(0.5, 0.5, 0.5))
    n, v = pairs(rng, 50)
    added = radiance(backscatter(lit, albedo=(0.1, 0.2, 0.3), illumination_rows=144), n, v) - radiance(
        miller1984(lit), n, v
    )
    assert np.allclose(added, [0.1, 0.2, 0.3], rtol=5e-3)


def test_a_direction_is_refracted_as_snell_says(rng):
    n, v = pairs(rng, 100)
    d = np.array(refracted_direction(vectors(n), vectors(v), mi.Float(1.5))).T
    assert np.allclose(np.linalg.norm(np.cross(n, d), axis=1) * 1.5, np.linalg.norm(np.cross(n, v), axis=1), atol=1e-5)
    assert ((d * n).sum(axis=1) < 0).all()
    assert np.allclose(np.einsum("ni,ni->n", np.cross(n, v), d), 0, atol=1e-6)  # in one plane
    assert ((d * v).sum(axis=1) < 0).all()


@pytest.mark.parametrize("view", [[0, 1, 0], [0, -1, 0], [0.6, 0, -0.8]])
def test_without_a_change_of_index_the_sphere_is_not_seen(view):
    """The environment behind it, in the direction away from the viewer, all over the map."""
    frame = view_frame(view)
    found = image(refraction(inputs(light(sky)), ior=1.0), frame, 32)[inside(32, 0.97)]
    assert np.allclose(found, sky(-frame[:, 2]), atol=0.05)


def test_head_on_a_medium_reflects_four_hundredths():
    """F = ((η − 1)/(η + 1))², of what lies behind the viewer, and the rest from straight ahead."""
    v = np.array([[0.0, 0.0, 1.0]])
    found = radiance(refraction(inputs(light(sky)), k=0.5), v, v)[0]
    assert np.allclose(found, 0.04 * sky(v)[0] + 0.5 * 0.96 * sky(-v)[0], rtol=0.02)


def test_a_pixel_shows_the_refracted_environment():
    frame = view_frame([0.3, 0.5, 0.8])
    n, v = normals(frame, 32), frame[:, 2]
    cosine = n @ v
    below = np.sqrt(1 - (1 - cosine**2) / 1.3**2)
    through = (cosine / 1.3 - below)[..., None] * n - v / 1.3
    found = image(refraction(inputs(light(sky)), ior=1.3), frame, 32)
    seen = inside(32, 0.5)  # where the Fresnel reflection is faint
    assert np.abs(found - sky(through))[seen].max() < 0.3
    assert np.abs(found - 0.983 * sky(through) - 0.017 * sky(2 * cosine[..., None] * n - v))[seen].max() < 0.05


@pytest.mark.parametrize("ior", [0.0, -1.5, np.nan, np.inf])
def test_an_index_that_is_none_is_refused(ior):
    with pytest.raises(InputError, match="ior"):
        refraction(inputs(light(sky, 16)), ior=ior)


def test_an_exponent_that_slips_through_the_table_is_refused():
    with pytest.raises(InputError, match="n_b"):
        backscatter(inputs(light(sky, 16), matte(1, 1, 1)), n_b=1e7, illumination_rows=36)

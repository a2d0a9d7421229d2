"""An image of the light on the device, against Mitsuba's own `envmap`."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.light.latlong_texture import LatLongTexture
from rsibr.light.radiance import light_of
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from tests.arrays import to_numpy, unit_vectors, vector

DIRECTIONS = np.array([[0, 1, 0], [0, -1, 0], [0, 0, -1], [1e-7, 0, -1], [-1e-7, 0, -1], [1, 0, 0], [0, 0, 1.0]])


def environment(tmp_path, shape, rng, rotation=0.0):
    image = rng.gamma(0.5, 2.0, (*shape, 3)).astype(np.float32)
    path = tmp_path / "sky.exr"
    mi.Bitmap(image).write(str(path))
    return load_environment(EnvironmentConfig(file=path, rotation_deg=rotation))


@pytest.mark.parametrize("shape", [(3, 2), (5, 8), (32, 64), (33, 17)])
@pytest.mark.parametrize("rotation", [0.0, 73.0])
def test_it_is_interpolated_as_mitsuba_does(tmp_path, rng, shape, rotation):
    """In all directions, the poles and the seam among them; texels are rounded to 8e-6 of their brightest channel."""
    sky = environment(tmp_path, shape, rng, rotation)
    light = light_of(sky, with_image=True)
    d = vector(np.concatenate([DIRECTIONS, unit_vectors(rng, 5000)]))
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(d))
    si.wi = -d
    expected = to_numpy(mi.load_dict({"type": "scene", "light": sky.emitter()}).environment().eval(si))
    found = to_numpy(LatLongTexture.of(light.image, light.frame).fetch(d))
    assert np.abs(found - expected).max() < 3e-5 * sky.image.max()


def test_no_image_of_another_size_needs_a_kernel_of_its_own(tmp_path, rng):
    d = vector(unit_vectors(rng, 64))

    def look(shape, rotation):
        light = light_of(environment(tmp_path, shape, rng, rotation), with_image=True)
        image = LatLongTexture.of(light.image, light.frame)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            dr.eval(image.fetch(d))
            launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
            dr.kernel_history_clear()
        return launched

    look((8, 16), 0.0)
    again = look((5, 7), 40.0)
    assert again
    assert all(kernel["cache_hit"] for kernel in again)


def test_only_what_shows_single_texels_keeps_the_image(tmp_path, rng):
    sky = environment(tmp_path, (8, 16), rng)
    assert light_of(sky, with_image=False).image is None
    assert light_of(sky, with_image=True).image is sky.image
    plain = load_environment(EnvironmentConfig(emitter={"type": "constant", "radiance": 2.0}))
    without = light_of(plain, with_image=True)
    assert without.image is None
    assert light_of(environment(tmp_path, (2, 4), rng), with_image=True).image is None  # Mitsuba resamples it
    assert len(without.picture) > len(light_of(plain, with_image=False).picture)


def test_an_image_that_is_stretched_is_not_kept(tmp_path, rng):
    """`to_world` may do more than turn: then the finer octahedral picture stands in."""
    image = rng.gamma(0.5, 2.0, (8, 16, 3)).astype(np.float32)
    path = tmp_path / "sky.exr"
    mi.Bitmap(image).write(str(path))
    scaled = np.diag([1.0, 2.0, 1.0, 1.0]).tolist()
    stretched = load_environment(
        EnvironmentConfig(emitter={"type": "envmap", "filename": str(path), "to_world": scaled})
    )
    assert stretched.frame is None
    assert light_of(stretched, with_image=True).image is None

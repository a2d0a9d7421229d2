"""Albedos under the light's own spectrum: against sums over wavelengths by hand."""

import numpy as np
import pytest

from rsibr import backend
from rsibr.light.radiance import light_map
from rsibr.lobes.adaptation import adapted_lobes
from rsibr.lobes.split import LobeSplit
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from tests.planning.metamers import GRID, light, lines, matte, metamers, seen_of

LAMP = lines(436, 546, 611)


def scene(bsdf, emitter):
    environment = load_environment(EnvironmentConfig(emitter=emitter))
    material = load_material(MaterialConfig(bsdf=bsdf))
    return LobeSplit.of(material.bsdf()), environment, material


@pytest.mark.parametrize("which", [0, 1])
def test_a_matte_albedo_is_the_colour_under_the_lamp_over_that_of_the_lamp(which):
    reflectance = metamers()[which]
    split, environment, material = scene(matte(reflectance), light(LAMP))
    (lobe,) = adapted_lobes(split, environment, material, "spectral")
    expected = seen_of(LAMP, reflectance) / seen_of(LAMP, np.ones_like(GRID))
    np.testing.assert_allclose(lobe.albedo[40], expected, rtol=0.02)  # the pigment is read every 7.5 nm
    assert np.abs(split.lobes[0].albedo[40] / expected - 1).max() > 0.1  # RGB's is another
    tint = np.array(lobe.proxy.coefficients[0]).sum(axis=0) / np.array(split.lobes[0].proxy.coefficients[0]).sum(axis=0)
    np.testing.assert_allclose(tint, expected / split.lobes[0].albedo[40], rtol=0.03)


def test_a_mirror_and_a_coat_keep_what_is_grey():
    split, environment, material = scene({"type": "plastic", "diffuse_reflectance": 0.5}, light(LAMP))
    for before, after in zip(split.lobes, adapted_lobes(split, environment, material, "spectral"), strict=True):
        np.testing.assert_allclose(after.albedo, before.albedo, rtol=2e-3, atol=1e-4)


def test_in_rgb_nothing_changes():
    split, environment, material = scene(matte(metamers()[1]), light(LAMP))
    assert adapted_lobes(split, environment, material, "rgb") is split.lobes


def test_a_channel_without_light_takes_the_albedo_of_luminance():
    """A lamp of 540 nm alone: its red and blue lie outside Rec.709, below zero."""
    split, environment, material = scene(
        {"type": "diffuse", "reflectance": 0.4},
        {"type": "constant", "radiance": {"type": "spectrum", "value": [[535.0, 0.0], [540.0, 1.0], [545.0, 0.0]]}},
    )
    (lobe,) = adapted_lobes(split, environment, material, "spectral")
    np.testing.assert_allclose(lobe.albedo, 0.4, rtol=5e-3)


def test_the_light_of_a_spectral_bake_is_what_an_observer_sees_of_it():
    """Also outside Rec.709, where RGB rendering clips."""
    environment = load_environment(EnvironmentConfig(emitter=light(LAMP)))
    with backend.rendering("spectral"):
        found = light_map(environment.emitter(), resolution=8)
    np.testing.assert_allclose(found, np.broadcast_to(seen_of(LAMP, np.ones_like(GRID)), found.shape), rtol=5e-3)

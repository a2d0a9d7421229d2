"""Matte part and gloss of a bake."""

from dataclasses import replace

import mitsuba as mi
import numpy as np

from rsibr.light.delta_lights import DeltaLights
from rsibr.shading.occlusion.material_parts import MaterialParts
from tests.shading.occlusion.objects import constant_light, inputs_of


def test_the_parts_are_the_albedos():
    parts = MaterialParts.of(inputs_of(constant_light((2, 2, 2)), matte=0.4, gloss=0.1))
    assert not parts.is_metal
    assert np.allclose(parts.matte_albedo, 0.4, atol=5e-3)
    assert np.allclose(parts.gloss_albedo, 0.1, atol=5e-3)
    assert np.allclose(np.array(parts.gloss.colour(mi.Float(0.5))), 0.1, atol=1e-5)
    assert np.allclose(np.array(parts.matte_radiance(mi.Vector3f(0, 0, 1), mi.Float(0.5))), 0.8, rtol=5e-3)


def test_a_light_without_extent_lights_the_matte_part():
    delta = DeltaLights(np.array([[0, 0, 1]], np.float32), np.array([[np.pi, 0, 0]], np.float32))
    parts = MaterialParts.of(inputs_of(replace(constant_light((0, 0, 0)), delta=delta), matte=0.4))
    n = mi.Vector3f([0, 0], [0, 0.6], [1, 0.8])
    assert np.allclose(np.array(parts.matte_radiance(n, mi.Float(0.7))).T, [[0.4, 0, 0], [0.32, 0, 0]], atol=1e-4)


def test_a_metal_has_no_matte_part():
    assert MaterialParts.of(inputs_of(constant_light(), matte=0.0, gloss=0.9)).is_metal

"""Environments whose texels say where they lie, or hold a source that no camera can expose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsibr.capture.lamps.hat import texel_centres
from rsibr.capture.lamps.lamp import Lamp
from rsibr.geometry.projections.latlong import MITSUBA
from rsibr.geometry.projections.sphere_image import SphereImage, converted
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment


def courtyard():
    return load_environment(EnvironmentConfig(file=scenes() / "environments" / "courtyard.exr"))


def of_image(image):
    """An environment of a map that no file holds."""
    return replace(courtyard(), image=np.ascontiguousarray(image, dtype=np.float32))


def directions_as_colours(height=128):
    """R, G, B = (1 + d)/2: what a pixel shows is where its light comes from."""
    return of_image(0.5 + 0.5 * texel_centres(height, 2 * height))


def resized(image, height):
    return converted(SphereImage(MITSUBA, image[None]), MITSUBA, (height, 2 * height)).values[0]


def with_a_sun(height=128, direction=(0.5, 0.6, 0.4), irradiance=(9.0, 8.0, 6.0), half_angle_deg=1.5, ceiling=3.0):
    """Map with a sun, the same as a camera would show it, and the sun's texels."""
    base = np.minimum(resized(courtyard().image, height), ceiling)
    lit = Lamp(direction, irradiance, half_angle_deg).added_to(base)
    sun = (lit - base).max(axis=2) > 0
    return lit, np.where(sun[..., None], np.float32(ceiling), lit), sun


def rel_mse(found, truth, where):
    """Relative squared error over the sphere, where directions were seen."""
    weights = MITSUBA.solid_angles(*MITSUBA.axes(truth.shape[:2]))[0] * where
    floor = (0.1 * truth.mean(axis=(0, 1))) ** 2
    return float((((found - truth) ** 2 / (truth**2 + floor)).mean(axis=2) * weights).sum() / weights.sum())

"""Lights and lobes with closed forms, and what a method reads of a bake, without a bake."""

from functools import cache
from types import SimpleNamespace

import numpy as np

from rsibr.geometry.projections.latlong import POLAR
from rsibr.geometry.projections.octahedral import texel_directions as octahedral_directions
from rsibr.geometry.projections.sphere_image import texel_directions
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light
from rsibr.lobes.albedo import NODES
from rsibr.lobes.gaussians import Gaussians, LobeShape
from tests.scene.maps import BLOBS

SHARP = 60.0


def polar_directions(rows, columns=None):
    """Directions of the texels' middles, shape (rows, columns, 3), in float64 and by the paper's formulas."""
    columns = columns or 2 * rows
    v = (np.arange(rows) + 0.5)[:, None] * np.pi / rows
    u = (np.arange(columns) + 0.5) * 2 * np.pi / columns
    return np.stack(np.broadcast_arrays(np.sin(v) * np.sin(u), np.cos(v), np.sin(v) * np.cos(u)), axis=-1)


def device_polar_directions(rows):
    return np.array(texel_directions(POLAR, rows)).T.reshape(rows, 2 * rows, 3)


def sky(direction):
    """Four narrow lights of different colours over a dim grey, radiance (..., 3)."""
    image = np.full((*direction.shape[:-1], 3), 0.05)
    for axis, colour in BLOBS.items():
        image += np.exp(SHARP * (direction @ np.array(axis) - 1.0))[..., None] * np.array(colour)
    return image


@cache
def light(radiance, resolution=256):
    """Light of a bake with the radiance of a function of directions (..., 3)."""
    d = np.array(octahedral_directions(resolution)).T.astype(np.float64)
    picture = np.broadcast_to(radiance(d), (len(d), 3)).reshape(resolution, resolution, 3).astype(np.float32)
    return Light(picture)


def one_light(direction, irradiance, resolution=64):
    """A light without extent in the dark."""
    d = np.asarray(direction, dtype=np.float32)[None]
    delta = DeltaLights(d / np.linalg.norm(d), np.asarray(irradiance, dtype=np.float32)[None])
    return Light(np.zeros((resolution, resolution, 3), np.float32), delta=delta)


def matte(*albedo):
    return LobeShape(0.25, Gaussians.none(), Gaussians.none(), np.array([albedo, (0, 0, 0)])), _table(albedo)


def glossy(sigma, albedo=(0.5, 0.5, 0.5), alpha=None):
    one = np.ones((1, 3))
    shape = LobeShape(
        alpha or sigma * np.sqrt(2), Gaussians(np.array([sigma]), one, 0 * one), Gaussians.none(), np.zeros((2, 3))
    )
    return shape, _table(albedo)


def mirror(albedo=(1, 1, 1)):
    return LobeShape.mirror(), _table(albedo)


def inputs(light, *lobes):
    """What `miller1984` reads of `MethodInputs`."""
    return SimpleNamespace(light=light, shapes={f"lobe {k}": lobe for k, lobe in enumerate(lobes)})


def _table(albedo):
    """Directional albedo that is not the same at every angle."""
    return np.linspace(1.0, 0.6, NODES)[:, None] * np.array(albedo, dtype=np.float64)

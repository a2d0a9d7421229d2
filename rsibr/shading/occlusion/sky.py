"""Environment split for gathering at points: an even part for rays about the normal, and small bright sources."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.geometry.to_device import to_device
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light

BRIGHT = 8.0
"""Radiance over the sky's mean above which it is a source: rays about the normal would meet it by chance."""

MOST_SOURCES = 64
"""Directions that stand for the bright part; each carries the same power."""

_FAINT = 1e-3  # share of the power below which there are no sources


@dataclass(eq=False)
class Sky:
    """Environment on the device.

    Attributes
    ----------
    even : EnvironmentPyramid
        Radiance up to `BRIGHT` times the mean, in one level.
    directions : mi.Float
        Unit directions to the sources, three floats each, flat.
    irradiance : mi.Float
        Irradiance of a surface that faces each [W m⁻²], RGB, flat.
    count : mi.UInt32
        Number of sources (opaque).
    """

    even: EnvironmentPyramid
    directions: mi.Float
    irradiance: mi.Float
    count: mi.UInt32

    @classmethod
    def of(cls, light: Light) -> Sky:
        """Split the environment of a bake; lights without extent are sources."""
        picture = light.picture.astype(np.float64)
        solid = texel_solid_angles(len(picture)).reshape(picture.shape[:2])
        grey = picture.mean(axis=2)
        mean = float((grey * solid).sum() / solid.sum())
        kept = np.minimum(1.0, BRIGHT * mean / np.maximum(grey, 1e-30))
        bright = picture * (1 - kept)[..., None]
        directions, irradiance = np.zeros((0, 3)), np.zeros((0, 3))
        if (bright.mean(axis=2) * solid).sum() > _FAINT * max(mean * 4 * np.pi, 1e-30):
            directions, irradiance = _drawn(bright, solid)
            picture = picture * kept[..., None]
        directions = np.concatenate([directions, light.delta.directions])
        irradiance = np.concatenate([irradiance, light.delta.irradiance])
        return cls(
            EnvironmentPyramid.finest_only(picture.astype(np.float32)),
            to_device(mi.Float, _filled(directions)),
            to_device(mi.Float, _filled(irradiance)),
            dr.opaque(mi.UInt32, len(directions)),
        )

    def source(self, k: mi.UInt32) -> tuple[mi.Vector3f, mi.Color3f]:
        """Direction and irradiance of a source."""
        x, y, z = (dr.gather(mi.Float, self.directions, 3 * k + axis) for axis in range(3))
        red, green, blue = (dr.gather(mi.Float, self.irradiance, 3 * k + axis) for axis in range(3))
        return mi.Vector3f(x, y, z), mi.Color3f(red, green, blue)


def _drawn(bright: NDArray[np.float64], solid: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions by systematic sampling of the texels; each carries the irradiance of its neighbours."""
    flux = (bright * solid[..., None]).reshape(-1, 3)
    order = _by_blocks(len(bright))
    power = np.cumsum(flux.mean(axis=1)[order])
    middles = (np.arange(MOST_SOURCES) + 0.5) / MOST_SOURCES * power[-1]
    chosen = np.unique(np.searchsorted(power, middles).clip(max=len(order) - 1))
    owner = np.searchsorted((power[chosen][1:] + power[chosen][:-1]) / 2, power)
    irradiance = np.stack([np.bincount(owner, flux[order, c], len(chosen)) for c in range(3)], axis=1)
    directions = np.array(texel_directions(len(bright)), np.float64).T[order[chosen]]
    return directions, np.asarray(irradiance, np.float64)


def _by_blocks(size: int) -> NDArray[np.int64]:
    """Texels in an order in which neighbours stay close: bits of row and column interleaved."""
    row, column = np.divmod(np.arange(size * size), size)
    key = np.zeros(size * size, np.int64)
    for bit in range(max(1, (size - 1).bit_length())):
        key |= ((row >> bit) & 1) << (2 * bit + 1) | ((column >> bit) & 1) << (2 * bit)
    return np.argsort(key, kind="stable")


def _filled(rows: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.asarray(rows if len(rows) else np.zeros((1, 3)), np.float32)

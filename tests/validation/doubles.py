"""Stand-ins for an environment and a material, small enough to know the answer by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from rsibr.validation.reference import Reference


@dataclass(frozen=True)
class Sky:
    """An environment from any Mitsuba emitter dictionary."""

    dictionary: dict[str, Any]

    def emitter(self):
        return dict(self.dictionary)


@dataclass(frozen=True)
class Matter:
    """A material from any Mitsuba BSDF dictionary."""

    dictionary: dict[str, Any]

    def bsdf(self):
        return mi.load_dict(dict(self.dictionary))


MIRROR = Matter({"type": "conductor", "material": "none"})
LAMBERT = Matter({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.5, 0.2]}})
GREY_SKY = Sky({"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 2.0, 0.5]}})
BLACK_SKY = Sky({"type": "constant", "radiance": {"type": "rgb", "value": 0.0}})


def slanted_sky(height: int = 256) -> Sky:
    """Radiance 1 + x/2, 1 + y/2, 1 + z/2 in red, green, blue of the unit direction: no symmetry is left.

    Laid out as measured of Mitsuba's `envmap`: rows from +Y to −Y, both on texel centres;
    u = 0 at −Z, 0.25 at +X, 0.5 at +Z.
    """
    u = (np.arange(2 * height) + 0.5) / (2 * height)
    azimuth, polar = np.meshgrid(2 * np.pi * u, np.linspace(0, np.pi, height))
    direction = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)], axis=-1)
    return Sky({"type": "envmap", "bitmap": mi.Bitmap((1 + direction / 2).astype(np.float32))})


def disk(resolution: int = 32) -> np.ndarray:
    """Coverage by the centre: 1 inside the unit disk, 0 outside."""
    centre = (np.arange(resolution) + 0.5) * 2 / resolution - 1
    return (np.hypot(centre[None, :], centre[:, None]) <= 1).astype(np.float32)


def noisy_reference(truth: np.ndarray, noise: float, rng: np.random.Generator, buffers: int = 8) -> Reference:
    """Buffers around `truth` whose mean has the relative standard error `noise` in every texel."""
    spread = noise * np.sqrt(buffers) * truth
    images = truth + spread * rng.standard_normal((buffers, *truth.shape))
    return Reference(images.astype(np.float32), disk(len(truth)), samples=64 * buffers, seconds=1.0)


def smooth_map(resolution: int = 32) -> np.ndarray:
    """Return a positive map with a gradient in each channel, float32."""
    ramp = np.linspace(0.2, 1.8, resolution, dtype=np.float32)
    return np.stack(np.broadcast_arrays(ramp[None, :], ramp[:, None], ramp[::-1, None]), axis=-1)

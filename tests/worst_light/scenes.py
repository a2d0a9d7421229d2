"""The worst lamps for a reconstruction from twelve views: four scenes, each an environment and the views that are hard in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.viewpoints import icosphere
from tests.scene.maps import latlong_directions

Array = NDArray[np.float64]

STORED: Array = icosphere(0).directions
A, B, C, D = 9, 4, 5, 11
"""Stored views of two triangles, (A, B, C) and (B, C, D), which share an edge."""

SKY = (0.04, 0.05, 0.07)
IRRADIANCE = 3.0


def unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def turned(start: Array, toward: Array, degrees: float) -> Array:
    """Direction `degrees` from `start` on the great circle through `toward`."""
    across = unit(toward - (toward @ start) * start)
    angle = np.radians(degrees)
    return np.asarray(np.cos(angle) * start + np.sin(angle) * across)


LAMP = turned(-STORED[A], -STORED[B], 10.0)
"""Behind view A but for 10°: view A sees it at grazing angles only, and no other view as badly."""


def pinpoint(height: int = 1024, width: int = 2048) -> Array:
    """Radiance (H, W, 3) of a lamp of one texel, 0.18° wide, over an even sky."""
    image, directions = np.tile(SKY, (height, width, 1)), latlong_directions(height, width)
    row, column = np.unravel_index(np.argmax(directions @ LAMP), (height, width))
    solid_angle = (np.pi / (height - 1)) * (2 * np.pi / width) * np.sin(np.pi * row / (height - 1))
    image[row, column] += IRRADIANCE / solid_angle
    return image


def soft_lamp(height: int = 256, width: int = 512, spread: float = np.radians(1.5)) -> Array:
    """Radiance (H, W, 3) of a Gaussian lamp of 1.5° standard deviation over an even sky."""
    cosine = latlong_directions(height, width) @ LAMP
    return np.array(SKY) + (IRRADIANCE / (2 * np.pi * spread**2)) * np.exp((cosine - 1) / spread**2)[..., None]


@dataclass(frozen=True)
class Case:
    """A scene: environment and hard views in it, by name."""

    image: Array
    views: dict[str, Array]


MIDDLE = unit(STORED[A] + STORED[B] + STORED[C])
EDGE = unit(STORED[B] + STORED[C])
OWN_EDGE = unit(STORED[A] + STORED[B])

VIEWS = {
    "facing": turned(LAMP, MIDDLE, 40.0),
    "grazing": turned(STORED[A], np.cross(STORED[A], LAMP), 8.0),
    "one horizon": MIDDLE,
    "two horizons": turned(STORED[C], MIDDLE, 6.0),
    "edge": EDGE,
    "own edge": OWN_EDGE,
}

MATERIALS = {
    "metal": {"type": "roughconductor", "distribution": "beckmann", "alpha": 0.1, "material": "Al"},
    "coat": {
        "type": "principled",
        "base_color": {"type": "rgb", "value": [0.5, 0.03, 0.02]},
        "roughness": 0.5,
        "clearcoat": 1.0,
        "clearcoat_gloss": 0.9,
    },
    "plastic": {
        "type": "roughplastic",
        "distribution": "beckmann",
        "alpha": 0.1,
        "diffuse_reflectance": {"type": "rgb", "value": [0.1, 0.27, 0.36]},
    },
}

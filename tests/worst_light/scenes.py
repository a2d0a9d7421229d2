"""Worst lamps for a reconstruction from twelve views: four scenes, each a lamp and the new views that are hard in it.

The stored views are the vertices of the icosahedron. A, B, C and D are four of them, in two triangles that share the
edge BC; `LAMP` shines at the back of A, 10° off its axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.viewpoints import icosphere
from tests.scene.maps import latlong_directions

Array = NDArray[np.float64]

SKY = (0.04, 0.05, 0.07)
"""Radiance of the even sky around a lamp [W sr⁻¹ m⁻²]."""

IRRADIANCE = 3.0
"""Irradiance of a lamp on a surface that faces it [W m⁻²], about 18 times that of the sky."""


def unit(v: Array) -> Array:
    """Direction of a vector."""
    return np.asarray(v / np.linalg.norm(v))


def turned(start: Array, toward: Array, degrees: float) -> Array:
    """Unit direction `degrees` from `start` on the great circle through `toward`."""
    across = unit(toward - (toward @ start) * start)
    angle = np.radians(degrees)
    return np.asarray(np.cos(angle) * start + np.sin(angle) * across)


def mirrors(lamp: Array, view: Array) -> Array:
    """Normal at which `view` sees the mirror image of the lamp."""
    return unit(lamp + view)


@dataclass(frozen=True, eq=False)
class Lamp:
    """A lamp over an even sky, as a latitude–longitude map.

    Attributes
    ----------
    direction : ndarray, shape (3,)
        Unit direction to its middle.
    radius : float
        Angle from its middle to its edge [rad]; 0: a single texel of the map.
    shape : tuple of int
        Rows and columns of the map.
    """

    direction: Array
    radius: float
    shape: tuple[int, int]

    def image(self) -> Array:
        """Radiance [W sr⁻¹ m⁻²], shape (H, W, 3); the lamp's irradiance is `IRRADIANCE` whatever its size."""
        cosine = latlong_directions(*self.shape) @ self.direction
        shining = cosine >= min(np.cos(self.radius), cosine.max())
        power = shining * texel_solid_angles(*self.shape)
        return np.array(SKY) + (IRRADIANCE / power.sum()) * shining[..., None]


def texel_solid_angles(height: int, width: int) -> Array:
    """Solid angle [sr] of the texels of a map, shape (H, 1); the rows on the poles count as nothing."""
    rows = np.sin(np.pi * np.arange(height) / (height - 1))
    return np.asarray(rows * (np.pi / (height - 1)) * (2 * np.pi / width))[:, None]


@dataclass(frozen=True, eq=False)
class Scene:
    """A lamp, and the new views that are hard under it.

    Attributes
    ----------
    lamp : Lamp
    views : dict of str to ndarray, shape (3,)
        Unit directions by name.
    """

    lamp: Lamp
    views: dict[str, Array]


STORED: Array = icosphere(0).directions
A, B, C, D = STORED[[9, 4, 5, 11]]

LAMP = Lamp(turned(-A, -B, 10.0), np.radians(1.0), (512, 1024))

PINPOINT = Lamp(unit(np.array([-0.7, 0.0, -0.714])), 0.0, (1025, 2048))
"""0.18° wide: smaller than a texel of the octahedral light map, and on the seam where that map folds back on itself."""

SMALL, GRAZING, HORIZON, EDGE = "smaller than a texel", "at grazing angles", "behind a horizon", "on an edge"

SCENES = {
    SMALL: Scene(
        PINPOINT,
        {
            "20° off": turned(PINPOINT.direction, np.array([0.2, 1.0, 0.3]), 40.0),
            "45° off": turned(PINPOINT.direction, np.array([1.0, -0.6, -0.5]), 90.0),
        },
    ),
    GRAZING: Scene(
        LAMP,
        {
            "84° off": turned(A, np.cross(A, LAMP.direction), 8.0),
            "80° off": turned(A, B, -10.0),
        },
    ),
    HORIZON: Scene(
        LAMP,
        {
            "of one view": unit(A + B + C),
            "of two views": turned(C, unit(A + B + C), 6.0),
        },
    ),
    EDGE: Scene(
        LAMP,
        {
            "beside the lamp": unit(B + C),
            "in its plane": unit(A + B),
        },
    ),
}
"""The scenes, by name. Angles are those between the normal and the view where the lamp is mirrored."""

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
"""Mitsuba BSDFs as plain data."""


def beside(view: Array, third: Array, distance: float) -> Array:
    """View at `distance` [rad] from a view on an edge, toward the stored view `third`; negative: away from it."""
    return turned(view, third, float(np.degrees(distance)))

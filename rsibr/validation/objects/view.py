"""Camera of an object's validation where none is given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rsibr.shading.camera import Camera
from rsibr.shading.object_scene import ObjectScene

FOV_DEG = 40.0
"""Horizontal field of view [°] of a camera that frames an object."""
FROM = (0.35, 0.4, 1.0)
"""Direction from the object to the camera where none is given."""
SIDE = 256
"""Pixels a side where none are given."""


def object_camera(
    scene: ObjectScene, position: ArrayLike | None = None, resolution: tuple[int, int] | None = None
) -> Camera:
    """Camera for a scene: the given position, else the scene's camera, else one that frames the object.

    Parameters
    ----------
    scene : ObjectScene
        Scene.
    position : array_like, shape (3,), optional
        Position in world coordinates; it looks at the middle of the object.
    resolution : tuple of two int, optional
        Width and height [pixels].
    """
    if position is None and scene.camera is not None:
        return scene.camera if resolution is None else replace(scene.camera, width=resolution[0], height=resolution[1])
    width, height = resolution or (SIDE, SIDE)
    half = math.tan(math.radians(FOV_DEG) / 2) * min(1.0, height / width)
    distance = scene.radius * math.hypot(1.0, 1.0 / half)
    if position is None:
        position = scene.centre + distance * np.array(FROM) / np.linalg.norm(FROM)
    return Camera.look_at(position, scene.centre, fov_deg=FOV_DEG, width=width, height=height)

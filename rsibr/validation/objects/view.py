"""Camera of an object's validation where none is given."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.fitted_camera import fitted_camera
from rsibr.shading.scenes.object_scene import ObjectScene

SIDE = 256
"""Pixels a side where none are given: enough for errors, and minutes of path tracing less than a picture to look at."""


def object_camera(
    scene: ObjectScene, position: ArrayLike | None = None, resolution: tuple[int, int] | None = None
) -> Camera:
    """Camera for a scene: from the given position, else the scene's camera, else one that sees the whole scene.

    Parameters
    ----------
    scene : ObjectScene
        Scene.
    position : array_like, shape (3,), optional
        Position in world coordinates; it looks at the middle of the scene.
    resolution : tuple of two int, optional
        Width and height [pixels]; by default the scene's camera's, else `SIDE`.
    """
    if position is None and scene.camera is not None:
        return scene.camera if resolution is None else replace(scene.camera, width=resolution[0], height=resolution[1])
    width, height = resolution or (SIDE, SIDE)
    if position is None:
        return fitted_camera(scene, width=width, height=height)
    return Camera.look_at(position, scene.centre, width=width, height=height)

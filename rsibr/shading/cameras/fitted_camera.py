"""Default camera of a scene that has none: the whole object from a three-quarter view."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.scenes.object_scene import ObjectScene

THREE_QUARTER = (1.0, 0.5, 1.5)
"""Direction from the object to the camera: from the front, to its right, above."""

_MARGIN = 1.06


def fitted_camera(
    scene: ObjectScene,
    direction: ArrayLike = THREE_QUARTER,
    fov_deg: float = 30.0,
    *,
    width: int = 512,
    height: int = 512,
) -> Camera:
    """Camera that sees a whole scene.

    It looks at the middle of the bounding box, from the least distance at which all corners of the box are in the
    picture, and 6 % more.

    Parameters
    ----------
    scene : ObjectScene
        Shapes.
    direction : array_like, shape (3,)
        From the object to the camera.
    fov_deg : float
        Horizontal field of view [degrees].
    width, height : int
        Pixels.

    Raises
    ------
    InputError
        If the direction is zero or no number, or the field of view is out of range.

    Examples
    --------
    >>> from rsibr.shading.scenes.scene_file import open_scene
    >>> camera = fitted_camera(open_scene("sphere"), (0, 0, 1))
    >>> camera.forward.tolist(), bool(camera.position[2] > 1)
    ([0.0, 0.0, -1.0], True)
    """
    toward = np.asarray(direction, dtype=np.float64)
    length = np.linalg.norm(toward)
    if not (math.isfinite(length) and length > 0):
        raise InputError(
            f"the direction {tuple(toward.tolist())}", where="camera", fix="give a direction to the camera"
        )
    toward = toward / length
    looking = Camera.look_at(scene.centre + toward, scene.centre, fov_deg=fov_deg, width=width, height=height)
    corners = np.array(list(itertools.product(*scene.bounds.T))) - scene.centre
    right, up, near = (corners @ looking.axes).T
    half = looking.half_width
    distance = np.max(near + np.maximum(np.abs(right) / half, np.abs(up) / (half * height / width)) * _MARGIN)
    return Camera.look_at(scene.centre + toward * distance, scene.centre, fov_deg=fov_deg, width=width, height=height)

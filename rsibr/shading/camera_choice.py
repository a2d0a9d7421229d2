"""Camera of a picture: the one that was asked for, the scene's, or one that sees the whole object."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError
from rsibr.shading.camera import Camera
from rsibr.shading.object_scene import ObjectScene

SIDE = 512
"""Pixels a side where neither the user nor the scene says."""
MOST_PIXELS = 16384
"""Most pixels a side."""
FOV_DEG = 40.0
"""Horizontal field of view by default [degrees]."""
THREE_QUARTERS = (1.0, 0.6, 1.5)
"""Direction from the object to the camera where none is given."""

_KEYS = ("position", "target", "up", "fov_deg", "direction")


def chosen_camera(
    scene: ObjectScene,
    camera: Camera | Mapping[str, Any] | None = None,
    resolution: int | tuple[int, int] | None = None,
) -> Camera:
    """Camera of a picture.

    Parameters
    ----------
    scene : ObjectScene
        Scene.
    camera : Camera or mapping, optional
        A mapping has `position` and, if wanted, `target` (by default the middle of the object), or `direction` (from
        the object to the camera, at the distance that shows the whole object); `up` and `fov_deg`. With `fov_deg`
        alone it is the scene's camera with this field of view. By default the scene's camera, else one that sees the
        whole object.
    resolution : int or (int, int), optional
        Pixels a side, or width and height; by default the camera's, or 512.

    Raises
    ------
    InputError
        If the mapping has other keys or no numbers, or the resolution is out of range.
    """
    size = None if resolution is None else _size(resolution)
    if isinstance(camera, Camera):
        return camera if size is None else camera.resized(*size)
    given = {} if camera is None else dict(camera)
    _check_keys(given)
    if scene.camera is not None and not given.keys() - {"fov_deg"}:
        own = replace(scene.camera, fov_deg=_fov(given, scene.camera.fov_deg))
        return own if size is None else own.resized(*size)
    return _looking(scene, given, size or (SIDE, SIDE))


def fitted_distance(radius: float, fov_deg: float, aspect: float) -> float:
    """Distance from which a sphere of some radius fills a picture, and is seen whole.

    Parameters
    ----------
    radius : float
        Radius of the sphere.
    fov_deg : float
        Horizontal field of view [degrees].
    aspect : float
        Height over width of the picture.
    """
    half = math.atan(math.tan(math.radians(fov_deg) / 2) * min(1.0, aspect))
    return radius / math.sin(half)


def _looking(scene: ObjectScene, given: Mapping[str, Any], size: tuple[int, int]) -> Camera:
    target, up = _vector(given, "target", scene.centre), _vector(given, "up", (0.0, 1.0, 0.0))
    fov_deg = _fov(given, FOV_DEG)
    if "position" in given:
        position = _vector(given, "position", target)
    else:
        direction = _vector(given, "direction", THREE_QUARTERS)
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise InputError("it has no length", where="camera.direction", fix="give a direction such as 1,0.5,2")
        radius = scene.radius + float(np.linalg.norm(target - scene.centre))
        position = target + fitted_distance(radius, fov_deg, size[1] / size[0]) * direction / length
    return Camera.look_at(position, target, up, fov_deg=fov_deg, width=size[0], height=size[1])


def _check_keys(given: Mapping[str, Any]) -> None:
    for key in given:
        if key not in _KEYS:
            near = get_close_matches(str(key), _KEYS, 1)
            meant = f"did you mean '{near[0]}'? " if near else ""
            raise InputError(f"unknown key '{key}'", where="camera", fix=f"{meant}there are: {', '.join(_KEYS)}")
    if {"position", "direction"} <= given.keys():
        raise InputError("both position and direction", where="camera", fix="give one of them")


def _vector(given: Mapping[str, Any], key: str, default: ArrayLike) -> NDArray[np.float64]:
    try:
        vector = np.asarray(given.get(key, default), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{given.get(key)!r} are not three numbers", where=f"camera.{key}", fix="give x, y, z")
    return vector


def _fov(given: Mapping[str, Any], default: float) -> float:
    value = given.get("fov_deg", default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.01 <= value <= 179:
        raise InputError(f"a field of view of {value!r}", where="camera.fov_deg", fix="give 0.01 to 179 degrees")
    return float(value)


def _size(resolution: int | tuple[int, int]) -> tuple[int, int]:
    sides = (resolution, resolution) if isinstance(resolution, int) else tuple(resolution)
    if len(sides) != 2 or not all(isinstance(side, int) and 1 <= side <= MOST_PIXELS for side in sides):
        fix = f"give one number or width and height, each 1 to {MOST_PIXELS}"
        raise InputError(f"{resolution!r} is no size of a picture", where="resolution", fix=fix)
    return sides[0], sides[1]

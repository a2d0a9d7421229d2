"""Camera of a picture: the one that was asked for, the scene's, or one that sees the whole object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError, did_you_mean
from rsibr.picture_size import MOST_PIXELS
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.fitted_camera import THREE_QUARTER, fitted_camera
from rsibr.shading.scenes.object_scene import ObjectScene

SIDE = 512
"""Pixels a side where neither the user nor the scene says."""
FOV_DEG = 30.0
"""Horizontal field of view by default [degrees]."""

_KEYS = ("position", "target", "up", "fov_deg", "direction")


def chosen_camera(
    scene: ObjectScene,
    camera: Camera | Mapping[str, Any] | None = None,
    resolution: int | tuple[int, int] | None = None,
    side: int = SIDE,
) -> Camera:
    """Camera of a picture.

    Parameters
    ----------
    scene : ObjectScene
        Scene.
    camera : Camera or mapping, optional
        A mapping has `position` and, if wanted, `target` (by default the middle of the object) and `up`; or
        `direction` (from the object to the camera, at the distance that shows the whole object); and `fov_deg`. With
        `fov_deg` alone it is the scene's camera with this field of view. By default the scene's camera, else one that
        sees the whole object.
    resolution : int or (int, int), optional
        Pixels a side, or width and height; by default the camera's.
    side : int
        Pixels a side where neither `resolution` nor a camera says.

    Raises
    ------
    InputError
        If the mapping has other keys or no numbers, or the resolution is out of range.
    """
    size = None if resolution is None else _size(resolution)
    if isinstance(camera, Camera):
        return camera if size is None else camera.resized(*size)
    given = _mapping(camera)
    _check_keys(given)
    if scene.camera is not None and not given.keys() - {"fov_deg"}:
        own = replace(scene.camera, fov_deg=_fov(given, scene.camera.fov_deg))
        return own if size is None else own.resized(*size)
    return _looking(scene, given, size or (side, side))


def _mapping(camera: object) -> dict[str, Any]:
    if camera is None:
        return {}
    if not isinstance(camera, Mapping):
        fix = "give a mapping, such as {'position': (3, 1, 4)}"
        raise InputError(f"{camera!r} is neither a Camera nor a mapping", where="camera", fix=fix)
    return dict(camera)


def _looking(scene: ObjectScene, given: Mapping[str, Any], size: tuple[int, int]) -> Camera:
    fov_deg, (width, height) = _fov(given, FOV_DEG), size
    if "position" not in given:
        direction = _vector(given, "direction", THREE_QUARTER)
        return fitted_camera(scene, direction, fov_deg, width=width, height=height)
    position, target = _vector(given, "position", ()), _vector(given, "target", scene.centre)
    up = _vector(given, "up", (0.0, 1.0, 0.0))
    return Camera.look_at(position, target, up, fov_deg=fov_deg, width=width, height=height)


def _check_keys(given: Mapping[str, Any]) -> None:
    for key in given:
        if key not in _KEYS:
            there = f"there are: {', '.join(_KEYS)}"
            raise InputError(f"unknown key '{key}'", where="camera", fix=did_you_mean(str(key), _KEYS) + there)
    if {"position", "direction"} <= given.keys():
        raise InputError("both position and direction", where="camera", fix="give one of them")
    if "position" not in given and (lone := given.keys() & {"target", "up"}):
        raise InputError(f"{min(lone)} without position", where="camera", fix="add a position")


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

"""Rotation of an emitter about the world's +Y axis, on plain data."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError

_Z_UP_TO_Y_UP = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
_Z_UP = ("sunsky", "timed_sunsky")
_WORLD_DIRECTIONS = ("direction", "sun_direction")


def rotation_about_y(angle_deg: float) -> NDArray[np.float64]:
    """Rotation matrix (4, 4) about +Y, counter-clockwise seen from above: +Z turns to +X, and +X to −Z."""
    angle = np.deg2rad(angle_deg % 360.0)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, 0, sine, 0], [0, 1, 0, 0], [-sine, 0, cosine, 0], [0, 0, 0, 1]], dtype=np.float64)


def rotated(plugin: dict[str, Any], angle_deg: float, where: str) -> dict[str, Any]:
    """Rotate an emitter about +Y.

    Parameters
    ----------
    plugin : dict
        Mitsuba emitter as plain data; `to_world`, if present, is a list of four rows of four numbers.
    angle_deg : float
        Angle [°], counter-clockwise seen from above.
    where : str
        Config key that an error names.

    Returns
    -------
    dict
        The emitter with `to_world` composed, or absent if it is the identity, and with its world-space directions
        rotated (`direction` of `directional`, `sun_direction` of `sunsky`).

    Notes
    -----
    Mitsuba's skies have their zenith at +Z. Without a `to_world`, a sky is rotated here to have its zenith at +Y.
    """
    rotation = rotation_about_y(angle_deg)
    result = dict(plugin)
    for key in _WORLD_DIRECTIONS:
        if key in result:
            result[key] = (rotation[:3, :3] @ _numbers(result[key], (3,), f"{where}.{key}")).tolist()
    if "direction" in result:  # which Mitsuba accepts only without to_world
        return result
    upright = _Z_UP_TO_Y_UP if plugin["type"] in _Z_UP else np.eye(4)
    frame = rotation @ _numbers(result.get("to_world", upright), (4, 4), f"{where}.to_world")
    if not np.array_equal(frame, np.eye(4)):  # a plugin without to_world refuses even that
        result["to_world"] = frame.tolist()
    return result


def turned(to_world: Any, angle: float) -> list[list[float]]:
    """Compose a matrix with a rotation about +Y that comes before it.

    Parameters
    ----------
    to_world : list of four rows of four numbers, or None
        The matrix; None: the identity.
    angle : float
        Angle [rad], counter-clockwise seen from above.

    Returns
    -------
    list of four rows of four numbers
    """
    outer = np.eye(4) if to_world is None else np.array(to_world, dtype=np.float64)
    composed: list[list[float]] = (outer @ rotation_about_y(np.rad2deg(angle))).tolist()
    return composed


def _numbers(value: Any, shape: tuple[int, ...], where: str) -> NDArray[np.float64]:
    fix = "write a vector [x, y, z]" if shape == (3,) else "write four rows of four numbers"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{value} is not made of numbers", where=where, fix=fix) from None
    if array.shape != shape:
        raise InputError(f"{value} has the wrong shape", where=where, fix=fix)
    return array

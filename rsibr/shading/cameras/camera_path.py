"""Cameras of a sequence: once around an object, or along a path."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.store.atomic import read_bytes

MOST_FRAMES = 100_000
"""Most frames of a sequence."""
_MOST_BYTES = 2**24
_KEYS = {"position": 3, "target": 3, "up": 3, "fov_deg": 1}
_DEFAULTS: dict[str, Any] = {"up": (0.0, 1.0, 0.0), "fov_deg": None}


@dataclass(frozen=True)
class Key:
    """Camera of a path, through which the sequence goes.

    Attributes
    ----------
    position, target, up : tuple of float
        World coordinates.
    fov_deg : float or None
        Horizontal field of view [degrees]; None: that of the camera.
    """

    position: tuple[float, ...]
    target: tuple[float, ...]
    up: tuple[float, ...]
    fov_deg: float | None


def turntable(camera: Camera, centre: ArrayLike, frames: int) -> list[Camera]:
    """Cameras once around a vertical axis, at equal angles, counter-clockwise seen from above.

    Parameters
    ----------
    camera : Camera
        First camera.
    centre : array_like, shape (3,)
        Point on the axis, which is parallel to +Y.
    frames : int
        Number of cameras; the one after the last would be the first again.
    """
    return [_turned(camera, np.asarray(centre, dtype=np.float64), 2 * math.pi * k / frames) for k in range(frames)]


def along_path(keys: Sequence[Key], camera: Camera, frames: int) -> list[Camera]:
    """Cameras along a path: cubic splines through its keys, at equal times from one key to the next.

    Parameters
    ----------
    keys : sequence of Key
        At least one; if the last is the first, the path is closed smoothly.
    camera : Camera
        Has the size of the picture, and the field of view of keys without one.
    frames : int
        Number of cameras, from the first key to the last.
    """
    rows = np.array([[*key.position, *key.target, *key.up, key.fov_deg or camera.fov_deg] for key in keys])
    rows[:, 9] = np.log(np.tan(np.radians(rows[:, 9]) / 2))  # a zoom is even in the size of what is seen
    track = _interpolated(rows, frames)
    fovs = np.degrees(2 * np.arctan(np.exp(track[:, 9])))
    return [
        Camera.look_at(row[:3], row[3:6], row[6:9], fov_deg=float(fov), width=camera.width, height=camera.height)
        for row, fov in zip(track, fovs, strict=True)
    ]


def read_path(file: Path) -> list[Key]:
    """Read the keys of a path: a JSON list of objects with `position`, `target`, and if wanted `up` and `fov_deg`.

    Raises
    ------
    InputError
        If it is no such list; the message names the key.
    BakeError
        If the file cannot be read.
    """
    if not file.is_file():
        raise InputError("there is no such file", where=str(file), fix="name a JSON list of cameras")
    try:
        found = json.loads(read_bytes(file, _MOST_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError("it is no JSON", where=str(file), fix="write a list of cameras") from error
    if not isinstance(found, list) or not found:
        fix = 'write [{"position": [x, y, z], "target": [x, y, z], "fov_deg": 40}, …]'
        raise InputError("it is no list of cameras", where=str(file), fix=fix)
    return [_key(one, f"{file}[{index}]") for index, one in enumerate(found)]


def _turned(camera: Camera, centre: NDArray[np.float64], angle: float) -> Camera:
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    return replace(camera, position=centre + turn @ (camera.position - centre), axes=turn @ camera.axes)


def _interpolated(rows: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """Rows at equal times, shape (frames, C)."""
    if len(rows) == 1:
        return np.repeat(rows, frames, axis=0)
    is_closed = len(rows) > 2 and np.array_equal(rows[0], rows[-1])
    curve = CubicSpline(np.arange(len(rows)), rows, bc_type="periodic" if is_closed else "natural")
    return np.asarray(curve(np.linspace(0, len(rows) - 1, frames)))


def _key(found: object, where: str) -> Key:
    if not isinstance(found, Mapping):
        raise InputError("it is no object", where=where, fix="write position, target and fov_deg in braces")
    unknown = [name for name in found if name not in _KEYS]
    if unknown:
        raise InputError(f"unknown key '{unknown[0]}'", where=where, fix=f"there are: {', '.join(_KEYS)}")
    values = {name: _numbers(found.get(name, _DEFAULTS.get(name, ())), name, where) for name in _KEYS}
    fov = values["fov_deg"][0] if values["fov_deg"] else None
    if fov is not None and not 0.01 <= fov <= 179:
        raise InputError(f"a field of view of {fov:g}", where=f"{where}.fov_deg", fix="give 0.01 to 179 degrees")
    if values["position"] == values["target"]:
        raise InputError("it looks at its own position", where=where, fix="move it away from its target")
    return Key(values["position"], values["target"], values["up"], fov)


def _numbers(value: object, name: str, where: str) -> tuple[float, ...]:
    if value is None and name == "fov_deg":
        return ()
    given: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
    is_number = [isinstance(one, int | float) and not isinstance(one, bool) and abs(one) < 1e30 for one in given]
    if len(given) != _KEYS[name] or not all(is_number):
        count = "one number" if _KEYS[name] == 1 else "three numbers"
        raise InputError(f"it is not {count}", where=f"{where}.{name}", fix="see docs/objects.md")
    return tuple(float(one) for one in given)

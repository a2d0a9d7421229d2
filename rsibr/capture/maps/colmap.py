"""Cameras of a reconstruction by COLMAP, from its text files `cameras.txt` and `images.txt`.

A line of `images.txt` holds the rotation from the world to the camera as a quaternion w, x, y, z, and the translation;
the next line, which may be empty, holds points and is skipped.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rsibr.capture.cameras.conventions import pose_of
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.errors import InputError
from rsibr.regular_file import read_regular

_FOCALS = {"PINHOLE": 2, "SIMPLE_PINHOLE": 1}
"""Models without distortion, and how many focal lengths they have."""

_UNDISTORT = "undistort the photographs (`colmap image_undistorter`), and name the folder that it writes, as text"


def colmap_cameras(folder: Path) -> dict[str, Pinhole]:
    """Camera of each photograph by its name.

    Parameters
    ----------
    folder : Path
        Folder with `cameras.txt` and `images.txt`.

    Raises
    ------
    InputError
        If a file cannot be read, a line is not as COLMAP writes it, or a camera has distortion.
    """
    models = _cameras(folder / "cameras.txt")
    file = folder / "images.txt"
    lines = [line for line in _text(file).split("\n") if not line.lstrip().startswith("#")]
    found = {}
    for line in lines[::2]:
        if not line.strip():
            continue
        try:
            _, *numbers = line.split(maxsplit=9)
            w, x, y, z, *shift = (float(one) for one in numbers[:7])
            model, name = models[int(numbers[7])], numbers[8].strip()
            matrix = np.column_stack([Rotation.from_quat([x, y, z, w]).as_matrix(), shift])
        except (ValueError, LookupError):
            raise InputError(f"'{line[:60]}' is no line of an image", where=str(file), fix=_UNDISTORT) from None
        found[name] = Pinhole(*model, *pose_of(matrix, "colmap"))
    if not found:
        raise InputError("names no photograph", where=str(file), fix=_UNDISTORT)
    return found


def _cameras(file: Path) -> dict[int, tuple[int, int, np.ndarray, np.ndarray]]:
    models = {}
    for line in _text(file).splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            number, model, width, height, *rest = line.split()
            values, key, size = [float(one) for one in rest], int(number), (int(width), int(height))
        except ValueError:
            raise InputError(f"'{line[:60]}' is no line of a camera", where=str(file), fix=_UNDISTORT) from None
        if model not in _FOCALS:
            raise InputError(f"camera {key} has the model {model}, with distortion", where=str(file), fix=_UNDISTORT)
        if len(values) != _FOCALS[model] + 2:
            raise InputError(f"camera {key} has {len(values)} parameters", where=str(file), fix=_UNDISTORT)
        focal = np.array(values[:-2] if len(values) == 4 else values[:1] * 2)
        models[key] = (*size, focal, np.array(values[-2:]))
    return models


def _text(file: Path) -> str:
    try:
        return read_regular(file).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"cannot be read ({error})", where=str(file), fix="name the folder of COLMAP's text files"
        ) from None

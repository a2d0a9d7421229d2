"""Poses in the conventions of other programs; each is named, none is guessed.

| name | pose | columns of the camera |
|---|---|---|
| `opencv` | camera to world | right, down, forward |
| `opengl` | camera to world | right, up, backward; also Blender's and NeRF's |
| `colmap` | world to camera | right, down, forward |
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError, did_you_mean

Pose = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Position, and axes with the columns right, down, forward."""


def _opencv(matrix: NDArray[np.float64]) -> Pose:
    return matrix[:3, 3], matrix[:3, :3]


def _opengl(matrix: NDArray[np.float64]) -> Pose:
    return matrix[:3, 3], matrix[:3, :3] * np.array([1.0, -1.0, -1.0])


def _colmap(matrix: NDArray[np.float64]) -> Pose:
    rotation = matrix[:3, :3]
    return -rotation.T @ matrix[:3, 3], rotation.T


CONVENTIONS: dict[str, Callable[[NDArray[np.float64]], Pose]] = {
    "opencv": _opencv,
    "opengl": _opengl,
    "colmap": _colmap,
}
"""Pose of a matrix, by the name of its convention."""


def pose_of(matrix: ArrayLike, convention: str) -> Pose:
    """Position and axes of a pose.

    Parameters
    ----------
    matrix : array_like, shape (4, 4) or (3, 4)
        Rotation and translation.
    convention : {"opencv", "opengl", "colmap"}
        What the matrix takes to what; see this module.

    Returns
    -------
    position : ndarray, shape (3,)
    axes : ndarray, shape (3, 3)
        Columns right, down, forward in world coordinates.

    Raises
    ------
    InputError
        If the convention is unknown, or the matrix has another shape.

    Examples
    --------
    >>> position, axes = pose_of(np.eye(4), "opengl")
    >>> axes[:, 2].tolist()     # OpenGL's camera looks along −z
    [-0.0, -0.0, -1.0]
    """
    if convention not in CONVENTIONS:
        fix = f"{did_you_mean(convention, CONVENTIONS)}name one of: {', '.join(CONVENTIONS)}"
        raise InputError(f"unknown convention '{convention}' of poses", where="convention", fix=fix)
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape not in ((4, 4), (3, 4)):
        raise InputError(f"a pose of shape {array.shape}", where="pose", fix="give 3 or 4 rows of 4 numbers")
    return CONVENTIONS[convention](array)

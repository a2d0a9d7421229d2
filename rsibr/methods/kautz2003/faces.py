"""Faces of a cube as arrays: area-weighted reduction, box-filtered MIP levels, and borders from adjoining faces."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import texel_solid_angles

Faces = NDArray[np.floating[Any]]
"""Radiance [W sr⁻¹ m⁻²] of the texels of a cube, shape (6, N, N, 3), faces as in the projection "cube"."""


def checked(faces: Faces) -> Faces:
    """Return faces of the right shape; raises an InputError otherwise."""
    shape = np.shape(faces)
    if len(shape) != 4 or shape[0] != 6 or shape[1] != shape[2] or shape[3] != 3 or shape[1] & (shape[1] - 1):
        raise InputError(
            f"faces of shape {shape}", where="kautz2003", fix="give six square faces, (6, N, N, 3), N a power of two"
        )
    return faces


def averaged(faces: Faces, size: int) -> Faces:
    """Mean radiance over the texels of coarser faces, weighted by solid angle.

    Parameters
    ----------
    faces : ndarray, shape (6, N, N, 3)
        Finer faces.
    size : int
        Texels a side of the coarser ones, a divisor of N.
    """
    own = faces.shape[1]
    if own == size:
        return faces
    angles = _angles(own)
    energy = _block_sums(faces * angles[..., None], size)
    return np.asarray(energy / _block_sums(angles[..., None], size), dtype=faces.dtype)


def box_levels(faces: Faces) -> list[Faces]:
    """MIP levels, each the mean of 2×2 texels of the one before, down to one texel a face.

    Each face by itself and without regard to solid angle, as graphics hardware does; Kautz et al. (2003), section 4.2.
    """
    levels = [faces]
    while levels[-1].shape[1] > 1:
        rows = levels[-1][:, ::2] + levels[-1][:, 1::2]
        levels.append(np.asarray((rows[:, :, ::2] + rows[:, :, 1::2]) * np.float32(0.25), dtype=faces.dtype))
    return levels


def bordered(faces: Faces, *, seams: bool, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Add a border of one texel to each face, for bilinear lookups.

    Parameters
    ----------
    faces : ndarray, shape (6, N, N, 3)
        One level.
    seams : bool
        Whether the border holds the texels of the adjoining faces, and at a corner the mean of the three texels that
        meet there: lookups are then continuous. Otherwise it repeats the face's own texels, as graphics hardware of
        2003 did.
    out : ndarray, shape (6, N + 2, N + 2, 3), optional
        Written to and returned; a new array by default.
    """
    size = faces.shape[1]
    wide = np.empty((6, size + 2, size + 2, 3), np.float32) if out is None else out
    wide[:, 1:-1, 1:-1] = faces
    edges: Sequence[Faces] | Faces = (faces[:, 0], faces[:, -1], faces[:, :, 0], faces[:, :, -1])
    if seams:
        edges = faces.reshape(-1, 3)[_beyond_edges(size)]
    wide[:, 0, 1:-1], wide[:, -1, 1:-1], wide[:, 1:-1, 0], wide[:, 1:-1, -1] = edges
    for row, inner_row in ((0, 1), (-1, -2)):
        for column, inner_column in ((0, 1), (-1, -2)):
            meeting = wide[:, row, inner_column] + wide[:, inner_row, column] + wide[:, inner_row, inner_column]
            wide[:, row, column] = meeting / 3  # without seams all three are the face's own texel
    return wide


@lru_cache(maxsize=32)
def _beyond_edges(size: int) -> NDArray[np.intp]:
    """Index of the texel across each edge, shape (4, 6, size): top, bottom, left, right; kept, for each frame asks."""
    index = np.arange(6 * size * size, dtype=np.float32).reshape(6, size, size, 1)
    wide = projection("cube").bordered(index)[..., 0]
    edges = [wide[:, 0, 1:-1], wide[:, -1, 1:-1], wide[:, 1:-1, 0], wide[:, 1:-1, -1]]
    return np.stack(edges).astype(np.intp)


@lru_cache(maxsize=4)
def _angles(size: int) -> NDArray[np.float32]:
    """Solid angles [sr] of the texels, shape (6, size, size)."""
    return np.asarray(texel_solid_angles(projection("cube"), size), dtype=np.float32).reshape(6, size, size)


def _block_sums(values: Faces, size: int) -> Faces:
    side = values.shape[1] // size
    rows = values.reshape(6, size, side, -1).sum(axis=2)  # whole rows first: eight times as fast as both axes at once
    return np.asarray(rows.reshape(6, size, size, side, -1).sum(axis=3))

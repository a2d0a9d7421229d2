"""Octahedral projection: the whole sphere on one square, without poles and with a cheap inverse.

A direction is projected onto the octahedron |x| + |y| + |z| = 1, and its lower half is folded outward over the upper
one. In an image of R×R texels column i lies at x = 2(i+½)/R − 1 and row j at y = 2(j+½)/R − 1; +z is the middle.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray


def square_from_direction(d: mi.Vector3f) -> mi.Point2f:
    """Map point of a direction, in the octahedral projection.

    Parameters
    ----------
    d : mi.Vector3f
        Directions of any positive length.

    Returns
    -------
    mi.Point2f
        Points of the square [−1, 1]².

    Notes
    -----
    Praun & Hoppe (2003), section 4; branch-free form of Cigolle et al. (2014), listing 1.

    Examples
    --------
    >>> p = square_from_direction(mi.Vector3f(0, 3, 0))
    >>> p, direction_from_square(p)
    ([[0, 1]], [[0, 1, 0]])
    """
    shrink = dr.rcp(dr.abs(d.x) + dr.abs(d.y) + dr.abs(d.z))
    x, y = d.x * shrink, d.y * shrink
    below = d.z < 0
    folded_x, folded_y = dr.mulsign(1 - dr.abs(y), x), dr.mulsign(1 - dr.abs(x), y)
    return mi.Point2f(dr.select(below, folded_x, x), dr.select(below, folded_y, y))


def direction_from_square(p: mi.Point2f) -> mi.Vector3f:
    """Unit direction at a map point: the inverse of `square_from_direction`.

    Parameters
    ----------
    p : mi.Point2f
        Points of the square [−1, 1]².
    """
    z = 1 - dr.abs(p.x) - dr.abs(p.y)
    below = z < 0
    x = dr.select(below, dr.mulsign(1 - dr.abs(p.y), p.x), p.x)
    y = dr.select(below, dr.mulsign(1 - dr.abs(p.x), p.y), p.y)
    return dr.normalize(mi.Vector3f(x, y, z))


def texel_directions(resolution: int, right: float = 0.5, down: float = 0.5) -> mi.Vector3f:
    """Unit directions of one point in each texel, row-major.

    Parameters
    ----------
    resolution : int
        Texels a side, R.
    right, down : float
        Position in the texel, in [0, 1]; by default its centre.
    """
    index = dr.arange(mi.UInt32, resolution * resolution)
    column, row = mi.Float(index % resolution), mi.Float(index // resolution)
    step, right, down = (dr.opaque(mi.Float, value) for value in (2 / resolution, right, down))
    return direction_from_square(mi.Point2f((column + right) * step - 1, (row + down) * step - 1))


def texel_solid_angles(resolution: int) -> NDArray[np.float64]:
    """Solid angles [sr] of the texels, row-major, shape (R²,); they sum to 4π.

    Notes
    -----
    On a face of the octahedron, which is a plane, dω = cos θ/r² dA ∝ |p|⁻³ at the point p, that is, the cube of
    |x| + |y| + |z| of the unit direction.
    """
    share = np.abs(np.array(texel_directions(resolution), dtype=np.float64)).sum(axis=0) ** 3
    return np.asarray(share * (4 * np.pi / share.sum()))


def bordered(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Add a border of one texel, taken from across the edge where the projection folds back on itself.

    Parameters
    ----------
    image : ndarray, shape (R, R, C)
        An octahedral image.

    Returns
    -------
    ndarray, shape (R + 2, R + 2, C)
        With the border, bilinear lookups are continuous across the edges.
    """
    rows = np.concatenate([image[:1, ::-1], image, image[-1:, ::-1]])
    return np.ascontiguousarray(np.concatenate([rows[::-1, :1], rows, rows[::-1, -1:]], axis=1))

"""The sphere map: an orthographic picture of the unit sphere, seen from +z of its frame.

Map coordinates are points `p = (x, y)` of the unit disk, x right and y up; texture coordinates are s = x/2 + ½ and
t = y/2 + ½. In an image of N×N texels the centres lie at (i + ½)/N and row 0 is the top.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

LEAST_COVERAGE = 1e-3
"""Texels with less of their area in the disk count as outside a stored map: points in them are slow to find."""

TILE_WIDTH, TILE_HEIGHT = 16, 64
"""Texels a side (at most, for the height) of the tiles in which whole maps are worked through, row by row.

A row is one vector of the CPU, and down a tile each of its lanes goes through a stored map in even steps, which caches
foresee. At 512² tiles of 32×64, of 16×32 and of 16² take 1.1 to 1.2 times the time.
"""


def normal_from_disk(p: mi.Point2f) -> mi.Vector3f:
    """Surface normal at the map point `p`: g_normal.

    Parameters
    ----------
    p : mi.Point2f
        Points of the unit disk; points outside it are taken radially to the rim.

    Returns
    -------
    mi.Vector3f
        Unit normals in the map's frame, z ≥ 0. Cabral et al. (1999), section 3.3.
    """
    q = within_disk(p)
    return mi.Vector3f(q.x, q.y, dr.sqrt(dr.maximum(1 - dr.squared_norm(q), 0)))


def within_disk(p: mi.Point2f) -> mi.Point2f:
    """Points outside the unit disk taken radially to its rim: beyond it a map holds nothing."""
    return p * dr.minimum(1, dr.rsqrt(dr.maximum(dr.squared_norm(p), 1e-30)))


def disk_from_normal(n: mi.Vector3f) -> mi.Point2f:
    """Map point with the surface normal `n`: g_normal⁻¹.

    Normals that face away (z < 0) appear in no map; they are taken to the nearest point of the rim.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normals in the map's frame.

    Returns
    -------
    mi.Point2f
        Points of the closed unit disk.
    """
    p = mi.Point2f(n.x, n.y)
    return dr.select(n.z >= 0, p, p * dr.rsqrt(dr.maximum(dr.squared_norm(p), 1e-30)))


def reflection_from_disk(p: mi.Point2f) -> mi.Vector3f:
    """Mirror direction of the view at the map point `p`: g_mirror.

    Parameters
    ----------
    p : mi.Point2f
        Points of the unit disk.

    Returns
    -------
    mi.Vector3f
        Unit directions (2xz, 2yz, 2z² − 1) in the map's frame. Cabral et al. (1999), section 3.3.
    """
    n = normal_from_disk(p)
    return mi.Vector3f(2 * n.x * n.z, 2 * n.y * n.z, 2 * n.z * n.z - 1)


def disk_from_reflection(r: mi.Vector3f) -> mi.Point2f:
    """Map point that mirrors the view into `r`: g_mirror⁻¹.

    Parameters
    ----------
    r : mi.Vector3f
        Unit directions in the map's frame.

    Returns
    -------
    mi.Point2f
        Points of the closed unit disk. At the singularity r = −z the whole rim reflects into the one direction; the
        answer is then a point of the rim, or the centre of it all where r is −z to the last bit: finite either way.

    Notes
    -----
    The paper prints the half vector divided by |r + z|²; its length must be one, so the divisor is |r + z|.
    With |r + z|² = 2(1 + r_z), 1 + r_z is taken from the lateral part where r_z < 0, which cancels nothing.
    """
    lateral = r.x * r.x + r.y * r.y
    one_plus_z = dr.select(r.z >= 0, 1 + r.z, lateral / (1 - r.z))
    half_length = dr.rsqrt(dr.maximum(2 * one_plus_z, 1e-30))
    return mi.Point2f(r.x * half_length, r.y * half_length)


def texel_centre(index: mi.UInt32, resolution: int) -> mi.Point2f:
    """Map point of a texel's centre.

    Parameters
    ----------
    index : mi.UInt32
        Texels of an N×N image, row-major from the top left.
    resolution : int
        N, texels a side.

    Returns
    -------
    mi.Point2f
        Points of the square [−1, 1]².
    """
    row, column = index // resolution, index % resolution
    step = 2.0 / resolution
    return mi.Point2f((column + 0.5) * step - 1, 1 - (row + 0.5) * step)


def texel_centres(resolution: int) -> mi.Point2f:
    """Map points of all texel centres of an N×N image, row-major from the top left; see `texel_centre`."""
    return texel_centre(dr.arange(mi.UInt32, resolution * resolution), resolution)


def covered_middle(p: mi.Point2f, resolution: int) -> mi.Point2f:
    """Middle of what of a texel lies within the disk.

    Parameters
    ----------
    p : mi.Point2f
        Centres of texels.
    resolution : int
        Texels a side.

    Returns
    -------
    mi.Point2f
        The centre of a texel that lies within the disk. One that the rim cuts shows surfaces further in than its
        centre: at a radius of 0.9993 in a map of 64² texels the centre is seen at a grazing 2°, the middle at 7°.

    Notes
    -----
    Taken along the radius, as if a texel's sides faced the middle.
    """
    radius, half = dr.norm(p), 1 / resolution
    middle = 0.5 * (radius - half + dr.minimum(radius + half, 1))
    return dr.select(radius + half > 1, p * (middle / dr.maximum(radius, half)), p)


def tiled_texels(resolution: int) -> mi.UInt32:
    """Indices of all texels of an N×N image, tile by tile.

    Parameters
    ----------
    resolution : int
        N, texels a side.

    Returns
    -------
    mi.UInt32
        Row-major indices in the order of tiles of `TILE_WIDTH` by at most `TILE_HEIGHT` texels. Where N is no multiple
        of a tile's side, the last tiles repeat texels of the last row and column.

    Notes
    -----
    A warp turns: neighbours in a row of one map lie in a column of another. Tiles keep what is looked up together near
    together in memory, whatever the angle.
    """
    across = -(-resolution // TILE_WIDTH)
    down = -(-resolution // TILE_HEIGHT)
    height = -(-resolution // down)
    index = dr.arange(mi.UInt32, across * down * TILE_WIDTH * height)
    tile, within = index // (TILE_WIDTH * height), index % (TILE_WIDTH * height)
    row = (tile // across) * height + within // TILE_WIDTH
    column = (tile % across) * TILE_WIDTH + within % TILE_WIDTH
    return dr.minimum(row, resolution - 1) * resolution + dr.minimum(column, resolution - 1)


def texel_coverage(resolution: int) -> NDArray[np.float64]:
    """Share of each texel's area that lies inside the unit disk, exactly.

    Parameters
    ----------
    resolution : int
        N, texels a side.

    Returns
    -------
    ndarray, shape (N, N)
        Coverage in [0, 1]; it sums to π N²/4.
    """
    edges = np.linspace(-1.0, 1.0, resolution + 1)
    corner = _signed_disk_area(edges[None, :], edges[:, None])
    area = corner[1:, 1:] - corner[1:, :-1] - corner[:-1, 1:] + corner[:-1, :-1]
    share = np.clip(area[::-1] * (resolution / 2.0) ** 2, 0.0, 1.0)
    x, y = np.abs(edges), np.abs(edges[::-1])
    farthest = np.hypot(np.maximum(x[1:], x[:-1])[None, :], np.maximum(y[1:], y[:-1])[:, None])
    share[farthest <= 1.0] = 1.0
    share[share < 1e-9] = 0.0  # rounding of texels that touch the disk in a point, if at all
    return share


def stored_coverage(resolution: int) -> NDArray[np.float32]:
    """Coverage of each texel as a stored map has it: `texel_coverage`, and 0 below `LEAST_COVERAGE`.

    Parameters
    ----------
    resolution : int
        N, texels a side.

    Returns
    -------
    ndarray, shape (N, N), float32
        Share of each texel inside the disk.
    """
    exact = texel_coverage(resolution)
    return np.where(exact < LEAST_COVERAGE, 0, exact).astype(np.float32)


def _signed_disk_area(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area of the unit disk inside the rectangle from the origin to (x, y), odd in each coordinate."""
    sign = np.sign(x) * np.sign(y)
    x, y = np.broadcast_arrays(np.minimum(np.abs(x), 1.0), np.minimum(np.abs(y), 1.0))
    chord = np.minimum(np.sqrt(1.0 - y * y), x)  # up to here the rectangle's top lies inside the disk

    def under_arc(u: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.5 * (u * np.sqrt(1.0 - u * u) + np.arcsin(u))

    return sign * (chord * y + under_arc(x) - under_arc(chord))

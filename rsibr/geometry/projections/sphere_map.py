"""Sphere map: orthographic projection of the unit sphere, seen from +z of its frame.

Map coordinates are points `p = (x, y)` of the unit disk, x right and y up; texture coordinates are s = x/2 + ½ and
t = y/2 + ½. In an image of N×N texels the centres lie at (i + ½)/N and row 0 is the top.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

LEAST_COVERAGE = 1e-3
"""Coverage below which a texel counts as outside a stored map: rejection sampling inside it would be slow."""

TILE_WIDTH, TILE_HEIGHT = 16, 64
"""Size of the tiles in which whole maps are evaluated, in texels; the height is a maximum.

A row of a tile is one vector of the CPU. Down a tile, each lane reads a stored map at an even stride, which caches
prefetch. At 512² texels, tiles of 32×64, 16×32 and 16² take 1.1 to 1.2 times the time.
"""


def normal_from_disk(p: mi.Point2f) -> mi.Vector3f:
    """Surface normal at the map point `p`: g_normal.

    Parameters
    ----------
    p : mi.Point2f
        Points of the unit disk; points outside are projected radially onto the rim.

    Returns
    -------
    mi.Vector3f
        Unit normals in the map's frame, z ≥ 0. Cabral et al. (1999), section 3.3.
    """
    q = within_disk(p)
    return mi.Vector3f(q.x, q.y, dr.sqrt(dr.maximum(1 - dr.squared_norm(q), 0)))


def within_disk(p: mi.Point2f) -> mi.Point2f:
    """Project points outside the unit disk radially onto its rim, beyond which a map is undefined."""
    return p * dr.minimum(1, dr.rsqrt(dr.maximum(dr.squared_norm(p), 1e-30)))


def disk_from_normal(n: mi.Vector3f) -> mi.Point2f:
    """Map point with the surface normal `n`: g_normal⁻¹.

    Normals that face away (z < 0) are not in the map; they are projected onto the nearest point of the rim.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normals in the map's frame.

    Returns
    -------
    mi.Point2f
        Points of the closed unit disk.

    Examples
    --------
    >>> disk_from_normal(normal_from_disk(mi.Point2f(0.6, 0)))
    [[0.6, 0]]
    """
    p = mi.Point2f(n.x, n.y)
    return dr.select(n.z >= 0, p, p * dr.rsqrt(dr.maximum(dr.squared_norm(p), 1e-30)))


def reflection_from_disk(p: mi.Point2f) -> mi.Vector3f:
    """Mirror direction of the viewer at the map point `p`: g_mirror.

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
    """Map point whose mirror direction is `r`: g_mirror⁻¹.

    Parameters
    ----------
    r : mi.Vector3f
        Unit directions in the map's frame.

    Returns
    -------
    mi.Point2f
        Points of the closed unit disk. At the singularity r = −z, into which the whole rim reflects, the result is a
        point of the rim, or the centre of the disk if r equals −z exactly. It is always finite.

    Notes
    -----
    Cabral et al. (1999) print the half vector divided by |r + z|²; a unit vector needs the divisor |r + z|.
    |r + z|² = 2(1 + r_z); for r_z < 0, 1 + r_z is computed as (r_x² + r_y²)/(1 − r_z), which has no cancellation.
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
    """Middle of the part of a texel inside the disk.

    Parameters
    ----------
    p : mi.Point2f
        Centres of texels.
    resolution : int
        Texels a side.

    Returns
    -------
    mi.Point2f
        The centre of a texel inside the disk. In a texel cut by the rim the point moves inward: at a radius of 0.9993
        in a map of 64² texels the view angle at the centre is 2° from grazing, at the middle 7°.

    Notes
    -----
    Computed along the radius only, as if the texel's sides were radial and tangential.
    """
    radius, half = dr.norm(p), 1 / resolution
    middle = 0.5 * (radius - half + dr.minimum(radius + half, 1))
    return dr.select(radius + half > 1, p * (middle / dr.maximum(radius, half)), p)


def tiled_texels(resolution: int) -> mi.UInt32:
    """Indices of all texels of an N×N image in tile order.

    Parameters
    ----------
    resolution : int
        N, texels a side.

    Returns
    -------
    mi.UInt32
        Row-major indices in the order of tiles of `TILE_WIDTH` by at most `TILE_HEIGHT` texels. If N is not a multiple
        of a tile's side, the last tiles repeat texels of the last row and column.

    Notes
    -----
    A warp rotates: neighbours in a row of one map lie in a column of another. With tiles, memory accesses are coherent
    at every angle.
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
    """Exact coverage: the share of each texel's area inside the unit disk.

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
    share[share < 1e-9] = 0.0  # rounding in texels that touch the disk at most in a point
    return share


def stored_coverage(resolution: int) -> NDArray[np.float32]:
    """Coverage as stored with a map: `texel_coverage`, with values below `LEAST_COVERAGE` set to 0.

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
    chord = np.minimum(np.sqrt(1.0 - y * y), x)  # the rectangle's top edge lies inside the disk up to here

    def under_arc(u: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.5 * (u * np.sqrt(1.0 - u * u) + np.arcsin(u))

    return sign * (chord * y + under_arc(x) - under_arc(chord))

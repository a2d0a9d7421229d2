"""Cube filtered with Phong's lobe, by quadrature over the texels of the light; Kautz et al. (2003), eq. 7.

Each texel of the result sums all texels of the light within reach of its lobe, in Dr.Jit. Blocks of texels out of
reach, large and small, are passed over. The light's faces are reduced to at least three texels a standard deviation of
the lobe, and those of the result are as fine.
"""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from rsibr.geometry.to_device import to_device
from rsibr.methods.kautz2003.faces import Faces, averaged

LEAST_SIZE, FINENESS = 32, 6.4
"""Texels a side of the result: at least, and times √N."""

_FAINTEST = 1e-6  # of the lobe's peak, where it is cut off
_LARGE, _SMALL = 32, 4  # texels a side of blocks of the light


def size_for(exponent: float, most: int) -> int:
    """Texels a side of the filtered cube: at least 3.2 a standard deviation 1/√N of the lobe, and at most `most`."""
    wanted = 1 << max(math.ceil(math.log2(FINENESS * math.sqrt(exponent))), 0)
    return min(max(LEAST_SIZE, wanted), most)


def phong_filtered(faces: Faces, exponent: float) -> NDArray[np.float32]:
    """Mean radiance over Phong's lobe around each texel's direction, (N+1)/2π ∫ max(r·l, 0)^N L dl.

    Parameters
    ----------
    faces : ndarray, shape (6, S, S, 3)
        Mean radiance [W sr⁻¹ m⁻²] of the light over texels, S a power of two.
    exponent : float
        Exponent N > 0.

    Returns
    -------
    ndarray, shape (6, R, R, 3), float32
        Radiance; equal to that of a constant light. R is `size_for`.

    Notes
    -----
    The paper's eq. 7 has k_s where this has (N+1)/2π: its k_s is ours times that, so that here a constant light of 1
    reflects as k_s for any N.
    """
    size = size_for(exponent, faces.shape[1])
    light, cones, (large, small) = _table(averaged(faces, size))
    texels, blocks, count = to_device(mi.Float, light), to_device(mi.Float, cones), dr.opaque(mi.UInt32, len(light))
    first_small = dr.opaque(mi.UInt32, len(light) // large)
    r = texel_directions(projection("cube"), size)
    n = dr.opaque(mi.Float, exponent)
    reach = math.acos(_FAINTEST ** (1 / exponent))
    cosine, sine = (dr.opaque(mi.Float, value) for value in (math.cos(reach), math.sin(reach)))

    def add(i: mi.UInt32, total: mi.Vector4f) -> tuple[mi.UInt32, mi.Vector4f]:
        # ---- At the first texel of a block: does the cone around it meet the lobe? cos(a + b) of half angles ----
        is_large = i % large == 0
        block = dr.gather(mi.Vector4f, blocks, dr.select(is_large, i // large, first_small + i // small))
        least = cosine * block.w - sine * dr.safe_sqrt(1 - block.w * block.w)
        is_far = (i % small == 0) & (dr.dot(r, mi.Vector3f(block.x, block.y, block.z)) < least)
        # ---- One texel ----
        d, energy = dr.gather(mi.Vector4f, texels, 2 * i), dr.gather(mi.Vector4f, texels, 2 * i + 1)
        c = dr.dot(r, mi.Vector3f(d.x, d.y, d.z))
        weight = dr.select(is_far | (c <= 0), 0, dr.power(dr.maximum(c, 1e-9), n))
        step = dr.select(is_far, dr.select(is_large, mi.UInt32(large), mi.UInt32(small)), 1)
        return i + step, total + weight * energy

    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Vector4f, 6 * size * size)),
        cond=lambda i, _total: i < count,
        body=add,
        labels=("i", "total"),
        label="phong_filter",
    )
    sums = np.array(total, dtype=np.float64)
    return np.asarray((sums[:3] / sums[3]).T.reshape(6, size, size, 3), dtype=np.float32)


def _table(faces: Faces) -> tuple[NDArray[np.float32], NDArray[np.float32], tuple[int, int]]:
    """Texels in the order of their blocks, and the cones around these.

    Returns
    -------
    texels : ndarray, shape (n, 8)
        Direction, 0, radiance times solid angle, solid angle.
    cones : ndarray, shape (blocks, 4)
        Unit axis and cosine of the half angle: those of the large blocks, then of the small ones.
    counts : (int, int)
        Texels in a large and in a small block.
    """
    size, cube = faces.shape[1], projection("cube")
    angles = texel_solid_angles(cube, size).reshape(-1, 1)
    directions = np.array(texel_directions(cube, size), dtype=np.float64).T
    rows = np.concatenate([directions, 0 * angles, faces.reshape(-1, 3) * angles, angles], axis=1)
    large, small = min(_LARGE, size), min(_SMALL, size)
    split = rows.reshape(6, size // large, large // small, small, size // large, large // small, small, 8)
    ordered = split.transpose(0, 1, 4, 2, 5, 3, 6, 7).reshape(-1, 8)
    cones = np.concatenate([_cones(ordered[:, :3].reshape(-1, side * side, 3)) for side in (large, small)])
    return ordered.astype(np.float32), cones.astype(np.float32), (large * large, small * small)


def _cones(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cones around blocks of directions (blocks, n, 3): unit axis and cosine of the half angle, shape (blocks, 4)."""
    axis = directions.sum(axis=1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    least = np.einsum("bic,bc->bi", directions, axis).min(axis=1)
    return np.concatenate([axis, np.minimum(least, 1)[:, None]], axis=1)

"""Faces with known content, and the harmonics that they are made of, without the code under test."""

import numpy as np
from scipy.special import sph_harm_y

FORWARD = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=float)
RIGHT = np.array([(0, 0, -1), (0, 0, 1), (1, 0, 0), (1, 0, 0), (1, 0, 0), (-1, 0, 0)], dtype=float)
UP = np.array([(0, 1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1), (0, 1, 0), (0, 1, 0)], dtype=float)


def directions(size, samples=1):
    """Unit directions of samples² points in each texel, shape (6, size, size, samples², 3), row 0 at the top."""
    u = (np.arange(size * samples) + 0.5) / (size * samples) * 2 - 1
    x, y = np.meshgrid(u, -u)
    d = FORWARD[:, None, None] + x[None, ..., None] * RIGHT[:, None, None] + y[None, ..., None] * UP[:, None, None]
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    blocks = d.reshape(6, size, samples, size, samples, 3).swapaxes(2, 3)
    return blocks.reshape(6, size, size, samples**2, 3)


def solid_angle(size, row, column, samples=16):
    """Solid angle [sr] of a texel, the same on every face, by the midpoint rule."""
    u = (np.arange(samples) + 0.5) / samples
    x, y = np.meshgrid(2 * (column + u) / size - 1, 2 * (row + u) / size - 1)
    return ((1 + x * x + y * y) ** -1.5).sum() * (2 / (size * samples)) ** 2


def faces_of(sky, size, samples=4):
    """Mean radiance over the texels of sky: (..., 3) → (..., 3), weighted by solid angle; shape (6, size, size, 3)."""
    d = directions(size, samples)
    weight = np.abs(d).max(axis=-1, keepdims=True) ** 3
    return ((sky(d) * weight).sum(axis=3) / weight.sum(axis=3)).astype(np.float32)


def grey(function):
    """Turn a scalar function of directions into radiance in three channels."""
    return lambda d: np.repeat(function(d)[..., None], 3, axis=-1)


def harmonic(band, order, d):
    """Real orthonormal harmonic of any band, z as its axis."""
    polar, azimuth = np.arccos(np.clip(d[..., 2], -1, 1)), np.arctan2(d[..., 1], d[..., 0])
    value = sph_harm_y(band, abs(order), polar, azimuth)
    if order == 0:
        return value.real
    return np.sqrt(2) * (-1) ** order * (value.real if order > 0 else value.imag)


NINE = [(0, 0), (1, -1), (1, 0), (1, 1), (2, -2), (2, -1), (2, 0), (2, 1), (2, 2)]
"""Band and order of Y_0 to Y_8; real harmonics in the paper's order."""

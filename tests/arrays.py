"""Between NumPy and Dr.Jit, for tests."""

import mitsuba as mi
import numpy as np


def vector(rows):
    """QuadratureTable (n, 3) as a mi.Vector3f of n lanes."""
    return mi.Vector3f(np.ascontiguousarray(np.asarray(rows, dtype=np.float32).T))


def point(rows):
    """QuadratureTable (n, 2) as a mi.Point2f of n lanes."""
    return mi.Point2f(np.ascontiguousarray(np.asarray(rows, dtype=np.float32).T))


def to_numpy(value):
    """A Dr.Jit array, or a tuple of them, as float64: components first, lanes last."""
    return np.asarray([np.array(v) for v in value] if isinstance(value, tuple) else np.array(value), dtype=np.float64)


def unit_vectors(rng, count):
    """Directions even over the sphere, rows of float64."""
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def disk_grid(resolution):
    """X and y of the texel centres, row 0 at the top, computed without the code under test."""
    u = (np.arange(resolution) + 0.5) / resolution * 2 - 1
    return np.meshgrid(u, -u)

"""Places of the rays in the square of a pixel: a rotated grid."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np


@cache
def slope(rays: int) -> int:
    """Slope z of the lattice of `rays` places: the one that keeps them farthest apart.

    Notes
    -----
    The places are the points (k, k·z mod n)/n of a lattice of n = rays + 1 points but the first, spread to the whole
    square: symmetric about the middle, and even in both projections. For 4, 16 and 64 rays it is a square grid, turned.
    """
    n = rays + 1
    z = np.arange(1, n)
    z = z[np.gcd(z, n) == 1][:, None]
    k = np.arange(1, n // 2 + 1)
    y = k * z % n
    nearest = (k**2 + np.minimum(y, n - y) ** 2).min(axis=1)
    return int(z[nearest.argmax(), 0])


def place_steps(rays: int) -> tuple[mi.Float, mi.Float]:
    """Steps of the lattice of a pixel's rays, across and down [pixels]; opaque, so that all numbers share kernels."""
    return dr.opaque(mi.Float, 1 / (rays + 1)), dr.opaque(mi.Float, slope(rays) / (rays + 1))


def place_in_pixel(k: mi.UInt32, steps: tuple[mi.Float, mi.Float]) -> mi.Point2f:
    """Place of ray number `k` in the square of its pixel, in (0, 1)², from the top left."""
    along = mi.Float(k + 1)
    place = mi.Point2f(along * steps[0], along * steps[1])
    return (place - dr.floor(place) - 0.5) * dr.rcp(1 - steps[0]) + 0.5

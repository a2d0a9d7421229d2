"""Solid angles and barycentric weights on the unit sphere, in forms without cancellation."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

Weights = tuple["mi.Float", "mi.Float", "mi.Float"]


def solid_angle(a: mi.Vector3f, b: mi.Vector3f, c: mi.Vector3f) -> mi.Float:
    """Signed solid angle of the spherical triangle (a, b, c).

    Parameters
    ----------
    a, b, c : mi.Vector3f
        Unit vectors, one triangle a lane.

    Returns
    -------
    mi.Float
        Solid angle [sr], positive when counter-clockwise seen from outside.

    Notes
    -----
    Van Oosterom & Strackee (1983), eq. 8, with the determinant taken of differences: relative error below 3e-7 in
    float32 down to icosphere subdivision 5, where the arccosine form of Cabral et al. (1999), section 3.4, is off by
    11 %.

    Examples
    --------
    >>> x, y, z = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1)
    >>> solid_angle(x, y, z) / dr.pi  # an octant: π/2 sr
    [0.5]
    """
    numerator = dr.dot(a, dr.cross(b - a, c - a))
    denominator = 1 + dr.dot(a, b) + dr.dot(b, c) + dr.dot(c, a)
    return 2 * dr.atan2(numerator, denominator)


def area_weights(v: mi.Vector3f, a: mi.Vector3f, b: mi.Vector3f, c: mi.Vector3f) -> Weights:
    """Spherical barycentric weights of `v`: the area of each sub-triangle over that of the triangle.

    Parameters
    ----------
    v : mi.Vector3f
        Unit view directions inside the triangle, one a lane.
    a, b, c : mi.Vector3f
        Unit vertices, counter-clockwise seen from outside.

    Returns
    -------
    tuple of mi.Float
        Weights of a, b, c: non-negative, sum 1, exactly one-hot at a vertex.

    Notes
    -----
    Cabral et al. (1999), section 3.4. From icosphere subdivision 1 on, where triangles are not equilateral, the weights
    are discontinuous across edges by up to 1.3e-3; `gnomonic_weights` are continuous.
    """
    return _normalized(solid_angle(v, b, c), solid_angle(v, c, a), solid_angle(v, a, b))


def gnomonic_weights(v: mi.Vector3f, a: mi.Vector3f, b: mi.Vector3f, c: mi.Vector3f) -> Weights:
    """Barycentric weights of the gnomonic projection of `v` onto the triangle's plane.

    Parameters and result as in `area_weights`. Continuous across edges at every subdivision.

    Notes
    -----
    v = αa + βb + γc gives α = det(v, b, c)/det(a, b, c). The common factor drops out; each determinant is taken of
    differences, det(v, b−v, c−v), which avoids cancellation in small triangles.

    Examples
    --------
    >>> x, y, z = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1)
    >>> gnomonic_weights(x, x, y, z)
    ([1], [0], [0])
    """
    return _normalized(_volume(v, b, c), _volume(v, c, a), _volume(v, a, b))


def _volume(v: mi.Vector3f, p: mi.Vector3f, q: mi.Vector3f) -> mi.Float:
    return dr.dot(v, dr.cross(p - v, q - v))


def _normalized(a: mi.Float, b: mi.Float, c: mi.Float) -> Weights:
    # On an edge the opposite weight is ±1 ulp, depending on which neighbour point location returned
    a, b, c = dr.maximum(a, 0), dr.maximum(b, 0), dr.maximum(c, 0)
    total = a + b + c  # divided, not multiplied by the reciprocal: x/x is exactly one, as a vertex requires
    return a / total, b / total, c / total

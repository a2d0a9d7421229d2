"""Half-vector map: all microfacet normals h that face the viewer, in stereographic projection from −v.

The projection is conformal: an isotropic kernel on the sphere is isotropic in the map, and its size changes by a factor
of two from the centre to the rim. The unit disk holds the hemisphere h·v ≥ 0. In an image of G×G texels the centres lie
at (i + ½)/G, row 0 is the top. See docs/method.md, eq. 3.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi


def half_vector_point(n: mi.Vector3f) -> mi.Point2f:
    """Map point of unit half-vectors in the frame of the map, z > −1."""
    scale = dr.rcp(1 + n.z)
    return mi.Point2f(n.x * scale, n.y * scale)


def half_vector(p: mi.Point2f) -> mi.Vector3f:
    """Unit half-vector at a map point: the inverse of `half_vector_point`."""
    squared = dr.squared_norm(p)
    scale = dr.rcp(1 + squared)
    return mi.Vector3f(2 * p.x * scale, 2 * p.y * scale, (1 - squared) * scale)


def angle_per_length(p: mi.Point2f) -> mi.Float:
    """Angle on the sphere [rad] over length in the map [radii of the disk], at a map point."""
    return 2 * dr.rcp(1 + dr.squared_norm(p))


def half_vector_texels(resolution: int, border: int = 0) -> mi.Point2f:
    """Map points of the texel centres of a G×G image with a border of `border` texels, row-major."""
    side = resolution + 2 * border
    index = dr.arange(mi.UInt32, side * side)
    step = 2.0 / resolution
    column, row = mi.Float(index % side) - border, mi.Float(index // side) - border
    return mi.Point2f((column + 0.5) * step - 1, 1 - (row + 0.5) * step)

"""Footprint of a ray: what the corners of its share of the pixel see of the same surface."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi


@dataclass
class Footprint:
    """Surfaces at the corners of the part of a pixel that a ray stands for, one ray a lane.

    With R rays a pixel, the part is a square with the area of 1/R pixel around the ray.

    Attributes
    ----------
    n : list of mi.Vector3f
        Safe shading normals at the corners: top left, top right, bottom right, bottom left.
    v : list of mi.Vector3f
        Unit directions to the viewer at the corners.
    is_extrapolated : mi.Bool
        Whether a corner misses the surface, so that its normal continues that of the opposite corner or of the ray.
    """

    n: list[mi.Vector3f]
    v: list[mi.Vector3f]
    is_extrapolated: mi.Bool

"""Coarse polar grid of normals over a sphere map, even in θ: denser toward the rim in the map, like the disk mesh."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

RINGS = 24
"""Rings from the centre to the rim, 3.75° of the normal apart."""

SECTORS = 48
"""Nodes a ring, 7.5° of azimuth apart."""

NODES = (RINGS + 1) * SECTORS
"""Nodes of a grid; ring 0 is the centre, with `SECTORS` coincident nodes."""


def node_normals(index: mi.UInt32) -> mi.Vector3f:
    """Normal at a node in the map's frame."""
    sine, cosine = dr.sincos(mi.Float(index // SECTORS) * (0.5 * np.pi / RINGS))
    s, c = dr.sincos(mi.Float(index % SECTORS) * (2 * np.pi / SECTORS))
    return mi.Vector3f(sine * c, sine * s, cosine)


def interpolated(nodes: mi.Float, n: mi.Vector3f, first: mi.UInt32 | int = 0) -> mi.Color3f:
    """Interpolate node values at normals in the map's frame, bilinearly in polar angle and azimuth.

    Parameters
    ----------
    nodes : mi.Float
        RGB0 of each node, of one grid or of several, flat.
    n : mi.Vector3f
        Unit normals, z ≥ 0.
    first : mi.UInt32 or int
        Index of the first node of the grid.
    """
    # ---- Cell of the grid and position in it ----
    angle = dr.asin(dr.minimum(dr.sqrt(n.x * n.x + n.y * n.y), 1)) * (2 / np.pi * RINGS)
    azimuth = dr.atan2(n.y, n.x) * (SECTORS / (2 * np.pi))
    turn = dr.select(azimuth < 0, azimuth + SECTORS, azimuth)
    ring, sector = dr.minimum(mi.UInt32(angle), RINGS - 1), dr.minimum(mi.UInt32(turn), SECTORS - 1)
    outward, around = angle - mi.Float(ring), turn - mi.Float(sector)
    following = dr.select(sector + 1 == SECTORS, 0, sector + 1)

    # ---- Bilinear interpolation ----
    def along(ring: mi.UInt32) -> mi.Vector4f:
        start = first + ring * SECTORS
        left, right = (dr.gather(mi.Vector4f, nodes, start + at) for at in (sector, following))
        return dr.lerp(left, right, around)

    value = dr.lerp(along(ring), along(ring + 1), outward)
    return mi.Color3f(value.x, value.y, value.z)


@dataclass(eq=False)
class PolarGrid:
    """Radiance at the nodes of one map.

    Attributes
    ----------
    nodes : mi.Float
        RGB0 of each node, flat.
    """

    nodes: mi.Float

    @staticmethod
    def normals() -> mi.Vector3f:
        """Normals at all nodes in the map's frame."""
        return node_normals(dr.arange(mi.UInt32, NODES))

    @classmethod
    def of(cls, radiance: mi.Color3f) -> PolarGrid:
        """Store the radiance [W sr⁻¹ m⁻²], one node of `normals` a lane."""
        return cls(dr.ravel(mi.Vector4f(radiance.x, radiance.y, radiance.z, 0)))

    def lookup(self, n: mi.Vector3f) -> mi.Color3f:
        """Radiance [W sr⁻¹ m⁻²] at normals in the map's frame."""
        return interpolated(self.nodes, n)

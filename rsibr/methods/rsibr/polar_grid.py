"""Coarse polar grid of normals over a sphere map, even in θ: denser toward the rim in the map, like the disk mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

RINGS = 16
"""Rings from the centre to the rim, 5.625° of the normal apart."""

SECTORS = 48
"""Nodes a ring, 7.5° of azimuth apart."""

NODES = (RINGS + 1) * SECTORS
"""Nodes of a grid; ring 0 is the centre, with `SECTORS` coincident nodes."""

_V = TypeVar("_V")


def node_normals(index: mi.UInt32) -> mi.Vector3f:
    """Normal at a node in the map's frame."""
    sine, cosine = dr.sincos(mi.Float(index // SECTORS) * (0.5 * np.pi / RINGS))
    s, c = dr.sincos(mi.Float(index % SECTORS) * (2 * np.pi / SECTORS))
    return mi.Vector3f(sine * c, sine * s, cosine)


def interpolated(n: mi.Vector3f, *fetches: Callable[[mi.UInt32], _V]) -> list[_V]:
    """Interpolate node values at normals in the map's frame, bilinearly in polar angle and azimuth.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normals, z ≥ 0.
    *fetches : callable
        Index of a node → its value; one callable for each quantity.

    Returns
    -------
    list
        Interpolated value of each quantity.
    """
    # ---- Cell of the grid and position in it ----
    angle = dr.asin(dr.minimum(dr.sqrt(n.x * n.x + n.y * n.y), 1)) * (2 / np.pi * RINGS)
    azimuth = dr.atan2(n.y, n.x) * (SECTORS / (2 * np.pi))
    turn = dr.select(azimuth < 0, azimuth + SECTORS, azimuth)
    ring, sector = dr.minimum(mi.UInt32(angle), RINGS - 1), dr.minimum(mi.UInt32(turn), SECTORS - 1)
    outward, around = angle - mi.Float(ring), turn - mi.Float(sector)
    following = dr.select(sector + 1 == SECTORS, 0, sector + 1)

    # ---- Bilinear interpolation ----
    def between(fetch: Callable[[mi.UInt32], _V]) -> _V:
        def along(ring: mi.UInt32) -> _V:
            value: _V = dr.lerp(fetch(ring * SECTORS + sector), fetch(ring * SECTORS + following), around)
            return value

        value: _V = dr.lerp(along(ring), along(ring + 1), outward)
        return value

    return [between(fetch) for fetch in fetches]


@dataclass(eq=False)
class PolarGrid:
    """Weighted radiance and weight of wide Gaussians at the nodes of one map.

    Attributes
    ----------
    nodes : mi.Float
        Two packets of four floats a node, flat: (radiance RGB, weight R), (weight G, weight B, 0, 0).
    """

    nodes: mi.Float

    @staticmethod
    def normals() -> mi.Vector3f:
        """Normals at all nodes in the map's frame."""
        return node_normals(dr.arange(mi.UInt32, NODES))

    @classmethod
    def of(cls, light: mi.Color3f, weight: mi.Color3f) -> PolarGrid:
        """Store weighted radiance [W sr⁻¹ m⁻²] and weight, one node of `normals` a lane."""
        first = mi.Vector4f(light.x, light.y, light.z, weight.x)
        second = mi.Vector4f(weight.y, weight.z, 0, 0)
        nodes = dr.empty(mi.Float, 8 * NODES)
        index = dr.arange(mi.UInt32, NODES)
        dr.scatter(nodes, first, 2 * index)
        dr.scatter(nodes, second, 2 * index + 1)
        return cls(nodes)

    def lookup(self, n: mi.Vector3f) -> tuple[mi.Color3f, mi.Color3f]:
        """Weighted radiance [W sr⁻¹ m⁻²] and weight at normals in the map's frame."""
        first, second = interpolated(
            n,
            lambda node: dr.gather(mi.Vector4f, self.nodes, 2 * node),
            lambda node: dr.gather(mi.Vector4f, self.nodes, 2 * node + 1),
        )
        return mi.Color3f(first.x, first.y, first.z), mi.Color3f(first.w, second.x, second.y)

"""A coarse grid over a sphere map, even in the angle of the surface and so finer toward the rim, like the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

RINGS = 16
"""Steps from the middle to the rim: 3.75° of the normal."""

SECTORS = 48


@dataclass(eq=False)
class PolarGrid:
    """Light gathered at the nodes, with its weight: what varies little over the map.

    Attributes
    ----------
    nodes : mi.Float
        Light and weight at each node, RGB both: (light, weight red), (weight green, weight blue, 0, 0), flat.
    """

    nodes: mi.Float

    @staticmethod
    def normals() -> mi.Vector3f:
        """Normals at the nodes in the map's frame; ring 0 is the middle, and each ring has `SECTORS` nodes."""
        index = dr.arange(mi.UInt32, (RINGS + 1) * SECTORS)
        sine, cosine = dr.sincos(mi.Float(index // SECTORS) * (0.5 * np.pi / RINGS))
        s, c = dr.sincos(mi.Float(index % SECTORS) * (2 * np.pi / SECTORS))
        return mi.Vector3f(sine * c, sine * s, cosine)

    @classmethod
    def of(cls, light: mi.Color3f, weight: mi.Color3f) -> PolarGrid:
        """Store what was gathered at `normals`."""
        first = mi.Vector4f(light.x, light.y, light.z, weight.x)
        second = mi.Vector4f(weight.y, weight.z, 0, 0)
        nodes = dr.empty(mi.Float, 8 * (RINGS + 1) * SECTORS)
        index = dr.arange(mi.UInt32, (RINGS + 1) * SECTORS)
        dr.scatter(nodes, first, 2 * index)
        dr.scatter(nodes, second, 2 * index + 1)
        return cls(nodes)

    def lookup(self, n: mi.Vector3f) -> tuple[mi.Color3f, mi.Color3f]:
        """Light and weight at normals in the map's frame, bilinear in angle and azimuth."""
        angle = dr.asin(dr.minimum(dr.sqrt(n.x * n.x + n.y * n.y), 1)) * (2 / np.pi * RINGS)
        azimuth = dr.atan2(n.y, n.x) * (SECTORS / (2 * np.pi))
        turn = dr.select(azimuth < 0, azimuth + SECTORS, azimuth)
        ring, sector = dr.minimum(mi.UInt32(angle), RINGS - 1), dr.minimum(mi.UInt32(turn), SECTORS - 1)
        outward, around = angle - mi.Float(ring), turn - mi.Float(sector)
        following = dr.select(sector + 1 == SECTORS, 0, sector + 1)

        def along(part: int) -> mi.Vector4f:
            def node(ring: mi.UInt32, sector: mi.UInt32) -> mi.Vector4f:
                return dr.gather(mi.Vector4f, self.nodes, 2 * (ring * SECTORS + sector) + part)

            inner = dr.lerp(node(ring, sector), node(ring, following), around)
            outer = dr.lerp(node(ring + 1, sector), node(ring + 1, following), around)
            return dr.lerp(inner, outer, outward)

        first, second = along(0), along(1)
        return mi.Color3f(first.x, first.y, first.z), mi.Color3f(first.w, second.x, second.y)

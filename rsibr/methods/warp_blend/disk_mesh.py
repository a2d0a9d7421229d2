"""Mesh warp of Cabral et al. (1999): exact at the vertices of a tessellated disk, linear between them."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.projections.sphere_map import disk_from_normal, normal_from_disk, within_disk
from rsibr.methods.warp_blend.warp import LEAST_CONFIDENCE, Warp


@dataclass(frozen=True)
class DiskMesh:
    """Disk of rings and sectors, finer toward the rim, where the warp is most curved.

    Attributes
    ----------
    rings : int
        Rings of vertices around the centre, at radii sin(k π/2 / rings): evenly spaced in surface angle, hence denser
        toward the rim. Cabral et al. (1999), section 3.3.
    sectors : int
        Vertices a ring.
    """

    rings: int = 16
    sectors: int = 48

    @property
    def vertex_count(self) -> int:
        """Total number of vertices; each ring repeats its first vertex as its last, so that no index wraps around."""
        return (self.rings + 1) * (self.sectors + 1)

    def vertex(self, index: mi.UInt32) -> mi.Point2f:
        """Map point of a vertex, one a lane; ring 0 is the centre."""
        ring, sector = index // (self.sectors + 1), index % (self.sectors + 1)
        radius = dr.sin(mi.Float(ring) * (0.5 * np.pi / self.rings))
        sine, cosine = dr.sincos(mi.Float(sector) * (2 * np.pi / self.sectors))
        return mi.Point2f(radius * cosine, radius * sine)

    def corners(self, p: mi.Point2f) -> tuple[mi.Vector3u, mi.Vector3f]:
        """Find the triangle that contains a map point.

        Parameters
        ----------
        p : mi.Point2f
            Points of the unit disk.

        Returns
        -------
        index : mi.Vector3u
            Vertices of the triangle.
        weight : mi.Vector3f
            Barycentric coordinates, sum 1; slightly negative between the outermost chord and the arc, where the
            triangles of the polygon are extrapolated.
        """
        # ---- Ring and sector of the point ----
        ring = mi.UInt32(dr.asin(dr.minimum(dr.norm(p), 1)) * (2 / np.pi * self.rings))
        azimuth = dr.atan2(p.y, p.x)
        turn = dr.select(azimuth < 0, azimuth + 2 * np.pi, azimuth) * (self.sectors / (2 * np.pi))
        sector = dr.minimum(mi.UInt32(turn), self.sectors - 1)
        ring = self._below_the_chord(p, dr.minimum(ring, self.rings - 1), sector)
        inner = ring * (self.sectors + 1) + sector
        outer = inner + self.sectors + 1
        # ---- The quad between two rings is split from its inner right to its outer left corner ----
        first = _barycentric(p, *(self.vertex(i) for i in (inner, outer, outer + 1)))
        second = _barycentric(p, *(self.vertex(i) for i in (inner, outer + 1, inner + 1)))
        in_second = (first.y < 0) & (ring > 0)
        index = dr.select(in_second, mi.Vector3u(inner, outer + 1, inner + 1), mi.Vector3u(inner, outer, outer + 1))
        return index, dr.select(in_second, second, first)

    def _below_the_chord(self, p: mi.Point2f, ring: mi.UInt32, sector: mi.UInt32) -> mi.UInt32:
        """Ring of triangles that contains p. A point between chord and arc of a ring lies in the next one outside."""
        outer = (ring + 1) * (self.sectors + 1) + sector
        a, b = self.vertex(outer), self.vertex(outer + 1)
        beyond = (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) < 0
        return dr.select(beyond, dr.minimum(ring + 1, self.rings - 1), ring)


@dataclass
class MeshWarp:
    """Warp evaluated at the mesh's vertices and interpolated linearly in the plane of the map.

    Takes three evaluations of the exact warp a lane; a whole map takes far fewer, see `MeshWarpBlend`.

    Attributes
    ----------
    mesh : DiskMesh
        Tessellation of the destination disk.
    exact : Warp
        Warp to interpolate.
    """

    mesh: DiskMesh
    exact: Warp

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        index, weight = self.mesh.corners(disk_from_normal(n))
        p, confidence = mi.Point2f(0), mi.Float(0)
        for corner, share in zip(index, weight, strict=True):
            at_corner, trust = self.exact(normal_from_disk(self.mesh.vertex(corner)))
            p, confidence = p + share * at_corner, confidence + share * trust
        return within_disk(p), dr.maximum(confidence, LEAST_CONFIDENCE)


def _barycentric(p: mi.Point2f, a: mi.Point2f, b: mi.Point2f, c: mi.Point2f) -> mi.Vector3f:
    def doubled_area(u: mi.Point2f, w: mi.Point2f) -> mi.Float:
        return u.x * w.y - u.y * w.x

    whole = doubled_area(b - a, c - a)
    second, third = doubled_area(p - a, c - a) / whole, doubled_area(b - a, p - a) / whole
    return mi.Vector3f(1 - second - third, second, third)

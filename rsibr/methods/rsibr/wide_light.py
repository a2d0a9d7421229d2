"""Light of the wide Gaussians of all lobes, gathered over a map at the nodes of a polar grid of normals.

The mean light over a wide kernel varies slowly with the normal. It is integrated at the nodes of a coarse grid, from
the half-vector pyramid of the view, and interpolated. See docs/method.md, section 6.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.lobe_terms import GaussianTerm
from rsibr.methods.rsibr.half_vector_pyramid import RESOLUTION, HalfVectorPyramid, level_places
from rsibr.methods.rsibr.half_vector_quadrature import HalfVectorQuadrature
from rsibr.methods.rsibr.polar_grid import NODES, SECTORS, PolarGrid

Array = NDArray[np.float64]

POINTS = 224
"""Points of the quadrature at each ring, by default; see `HalfVectorQuadrature.of`."""

_STRIDE = 40  # lanes a node


@dataclass(frozen=True, eq=False)
class WideTables:
    """Wide Gaussians of a material on the host.

    Attributes
    ----------
    quadrature : HalfVectorQuadrature
        Points at each ring of the polar grid.
    resolution : int
        Texels a side of level 0 of the half-vector pyramid.
    share : ndarray, shape (NODES, 3)
        Share of the wide Gaussians in the albedo by cos θ.
    """

    quadrature: HalfVectorQuadrature
    resolution: int
    share: Array

    @classmethod
    def of(
        cls, terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm], resolution: int, points: int
    ) -> WideTables | None:
        """Place the points for the wide ones of `terms`; parameters and result as of `HalfVectorQuadrature.of`."""
        members = [(term, part) for term, part in zip(terms, parts, strict=True) if term.is_wide]
        quadrature = HalfVectorQuadrature.of(
            [term for term, _ in members], [part for _, part in members], resolution, points
        )
        if quadrature is None:
            return None
        return cls(quadrature, resolution, cast("Array", sum(part.share for _, part in members)))


@dataclass(eq=False)
class WideLight:
    """Wide Gaussians of a material on the device.

    Attributes
    ----------
    points : mi.Float
        For each ring of the polar grid and each point of the quadrature two packets of four floats, flat: place in the
        half-vector map for azimuth 0, start and side of its level of the pyramid; then weight RGB.
    count : mi.UInt32
        Points a ring (opaque).
    share : CosineTable
        Share of the wide Gaussians in the albedo by cos θ.
    """

    points: mi.Float
    count: mi.UInt32
    share: CosineTable

    @classmethod
    def of(
        cls,
        terms: Sequence[GaussianTerm],
        parts: Sequence[GaussianTerm],
        resolution: int = RESOLUTION,
        points: int = POINTS,
    ) -> WideLight | None:
        """Put the wide ones of `terms` on the device; None if there are none; see `HalfVectorQuadrature.of`."""
        tables = WideTables.of(terms, parts, resolution, points)
        return None if tables is None else cls.from_tables(tables)

    @classmethod
    def from_tables(cls, tables: WideTables) -> WideLight:
        """Put the points of a quadrature on the device."""
        quadrature = tables.quadrature
        rings, count = quadrature.levels.shape
        rows = np.zeros((rings, count, 2, 4))
        rows[..., 0, :2], rows[..., 1, :3] = quadrature.places, quadrature.weights
        starts, sides = (np.array(column) for column in level_places(tables.resolution))
        rows[..., 0, 2], rows[..., 0, 3] = starts[quadrature.levels], sides[quadrature.levels]
        points = to_device(mi.Float, rows.astype(np.float32))
        return cls(points, dr.opaque(mi.UInt32, count), CosineTable.of(tables.share))

    def grid(self, pyramid: HalfVectorPyramid) -> PolarGrid:
        """Mean light [W sr⁻¹ m⁻²] of the wide Gaussians at the nodes of a polar grid over the map of `pyramid`."""
        # ---- A lane sums every _STRIDE-th point of a node: one a node would keep a single thread busy ----
        lane = dr.arange(mi.UInt32, NODES * _STRIDE)
        node = lane // _STRIDE
        first = node // SECTORS * self.count
        sine, cosine = dr.sincos(mi.Float(node % SECTORS) * (2 * np.pi / SECTORS))

        def gather(k: mi.UInt32, light: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
            place, weight = (dr.gather(mi.Vector4f, self.points, 2 * (first + k) + row) for row in range(2))
            p = mi.Point2f(cosine * place.x - sine * place.y, sine * place.x + cosine * place.y)
            found = pyramid.light(p, mi.UInt32(place.z), mi.UInt32(place.w))
            return k + _STRIDE, light + mi.Color3f(weight.x, weight.y, weight.z) * found

        _, light = dr.while_loop(
            state=(lane % _STRIDE, dr.zeros(mi.Color3f, NODES * _STRIDE)),
            cond=lambda k, _light: k < self.count,
            body=gather,
            labels=("k", "light"),
            label="wide_gaussians",
        )
        dr.eval(light)  # once, not for each channel
        return PolarGrid.of(mi.Color3f(*(dr.block_sum(channel, _STRIDE) for channel in light)))

    def radiance(self, n: mi.Vector3f, grid: PolarGrid) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²] at normals in the map's frame, from `grid`."""
        return self.share.colour(n.z) * grid.lookup(n)

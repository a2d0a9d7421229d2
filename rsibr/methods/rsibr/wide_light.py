"""Light of the wide Gaussians of all lobes, gathered once over normals and views.

The mean light over a wide kernel varies slowly with normal and view. It is integrated by quadrature at the nodes of a
polar grid of normals for each of 162 views (the vertices of an icosphere), for a few groups of Gaussians of similar
width. A pair (n, v) is looked up at the three nodes around v, each at the normal that mirrors the node's view into the
same direction, and blended by gnomonic weights. The tables hold mean radiance, that is weighted radiance over weight;
the share of each group in the albedo depends on the angle between normal and view alone. See docs/method.md, section 9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.frame import frame_of
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import ViewSphere, icosphere
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.rsibr.lobe_terms import WIDE, GaussianTerm
from rsibr.methods.rsibr.polar_grid import NODES, PolarGrid, interpolated, node_normals
from rsibr.methods.rsibr.slope_quadrature import SlopeQuadrature

Array = NDArray[np.float64]

SUBDIVISION = 2
"""Subdivision of the icosphere of view nodes: 162 nodes, 16° to 19° apart."""

GROUPS = (WIDE, 2 * WIDE, 4 * WIDE, np.inf)
"""Standard deviations between the groups: within one they differ by a factor of two at most."""

_LEAST_CONFIDENCE = 1e-4  # minimum cosine of a node's normal, reached at the node's horizon


@dataclass(eq=False)
class WideLight:
    """Mean light over the wide kernels of a material under an environment.

    Attributes
    ----------
    sphere : ViewSphere
        View nodes.
    tables : list of mi.Float
        For each group of Gaussians, mean radiance [W sr⁻¹ m⁻²] at each view node and normal of its polar grid, RGB0,
        flat (eq. 36).
    shares : list of CosineTable
        For each group, its share of the material's albedo by cos θ.
    total : CosineTable
        Sum of the shares.
    """

    sphere: ViewSphere
    tables: list[mi.Float]
    shares: list[CosineTable]
    total: CosineTable

    @classmethod
    def of(
        cls, terms: Sequence[GaussianTerm], parts: Sequence[GaussianTerm], environment: EnvironmentPyramid
    ) -> WideLight | None:
        """Gather the light of the wide ones of `terms`; None if there are none.

        Parameters
        ----------
        terms : sequence of GaussianTerm
            Gaussians of all lobes: they make the kernels.
        parts : sequence of GaussianTerm
            The same in the same order, with the shares that count: of all lobes, or of one.
        environment : EnvironmentPyramid
            Gaussian pyramid of the environment.
        """
        views, tables, shares = icosphere(SUBDIVISION), [], []
        for low, high in zip(GROUPS, GROUPS[1:], strict=False):
            members = [k for k, term in enumerate(terms) if low <= term.sigma < high]
            if members:
                quadrature = SlopeQuadrature.of([terms[k] for k in members])
                tables.append(_gathered(quadrature, environment, views.on_device, len(views)))
                shares.append(sum(parts[k].share for k in members))
        if not tables:
            return None
        counted = [CosineTable.of(cast("Array", share)) for share in shares]
        return cls(views.on_device, tables, counted, CosineTable.of(cast("Array", sum(shares))))

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²] of the wide Gaussians, one surface a lane; docs/method.md, eq. 37."""
        # ---- The three nodes around the view ----
        mirrored = 2 * dr.dot(n, v) * n - v
        nodes = self.sphere.surrounding(v)
        views = [self.sphere.direction(node) for node in nodes]
        # ---- Mean radiance at the normal that mirrors each node's view into the same direction, cosine-weighted ----
        light, total = [mi.Color3f(0) for _ in self.tables], mi.Float(0)
        for node, view, share in zip(nodes, views, gnomonic_weights(v, *views), strict=True):
            half = mirrored + view
            normal = half * dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-12))
            trusted = share * dr.maximum(dr.dot(normal, view), _LEAST_CONFIDENCE)
            light = [a + trusted * b for a, b in zip(light, self._at(node, frame_of(view).T @ normal), strict=True)]
            total += trusted
        # ---- Share of the albedo at the true angle ----
        radiance = mi.Color3f(0)
        for mean, share in zip(light, self.shares, strict=True):
            radiance += share.colour(cosine) * mean
        return radiance * (1 / total)

    def grid(self, frame: mi.Matrix3f) -> PolarGrid:
        """Mean radiance of all groups at the nodes of a polar grid over the map with `frame`, columns x, y, v."""
        n = frame @ PolarGrid.normals()
        v = mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2])
        cosine = dr.dot(n, v)
        radiance = self.radiance(n, v, cosine)
        return PolarGrid.of(radiance / dr.maximum(self.total.colour(cosine), 1e-20))

    def radiance_in_map(self, n: mi.Vector3f, grid: PolarGrid) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²] at normals in the map's frame, from `grid`."""
        return self.total.colour(n.z) * grid.lookup(n)

    def _at(self, node: mi.UInt32, local: mi.Vector3f) -> list[mi.Color3f]:
        """Mean radiance of each group at a normal in a node's frame, bilinear on its polar grid."""
        first = node * NODES

        def fetch(table: mi.Float):  # noqa: ANN202
            return lambda index: dr.gather(mi.Vector4f, table, first + index)

        return [_rgb(mean) for mean in interpolated(local, *(fetch(table) for table in self.tables))]


def _gathered(quadrature: SlopeQuadrature, environment: EnvironmentPyramid, sphere: ViewSphere, views: int) -> mi.Float:
    """Mean radiance at every node of every view, RGB0, flat."""
    lane = dr.arange(mi.UInt32, NODES * views)
    v = sphere.direction(lane // NODES)
    n = frame_of(v) @ node_normals(lane % NODES)
    light, weight = quadrature.light(ShadingFrame.of(n, v), environment)
    mean = light / dr.maximum(weight, 1e-20)
    table = dr.ravel(mi.Vector4f(mean.x, mean.y, mean.z, 0))
    dr.eval(table)
    return table


def _rgb(values: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(values.x, values.y, values.z)

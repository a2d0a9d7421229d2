"""Table of the wide Gaussians of a lobe over normals and views; `rsibr` uses it to evaluate single points.

The quadrature over wide Gaussians takes most of the time of `rsibr-fine`, and its result varies slowly with normal and
view. It is therefore tabulated for 162 views (the vertices of an icosphere) on a polar grid of normals. A pair (n, v)
is looked up at the three nodes around v, each at the normal that mirrors the node's view into the same direction, and
blended by gnomonic weights. The table holds the mean radiance, that is weighted radiance over weight. The weight
depends on the angle between normal and view alone and has its own table. See docs/method.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.frame import frame_of
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import ViewSphere, icosphere
from rsibr.lobes.facet_moments import cosines
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.polar_grid import NODES, interpolated, node_normals

SUBDIVISION = 2
"""Subdivision of the icosphere of view nodes: 162 nodes, 16° to 19° apart."""

_LEAST_CONFIDENCE = 1e-4  # minimum cosine of a node's normal, reached at the node's horizon


@dataclass(eq=False)
class ViewNodes:
    """Mean radiance of the wide Gaussians of one lobe.

    Attributes
    ----------
    sphere : ViewSphere
        View nodes.
    light : mi.Float
        Mean radiance Λ_k [W sr⁻¹ m⁻²] for each view node and each normal of its polar grid, RGB0, flat (eq. 36).
    weight : CosineTable
        Weight B_k of the wide Gaussians by cos θ.
    """

    sphere: ViewSphere
    light: mi.Float
    weight: CosineTable

    @classmethod
    def of(cls, integral: LobeIntegral) -> ViewNodes:
        """Integrate the wide Gaussians of a lobe at all nodes."""
        views = icosphere(SUBDIVISION)
        sphere = views.on_device
        lane = dr.arange(mi.UInt32, NODES * len(views))
        v = sphere.direction(lane // NODES)
        n = frame_of(v) @ node_normals(lane % NODES)
        light, weight = integral.wide_light(ShadingFrame.of(n, v))
        mean = light / dr.maximum(weight, 1e-20)
        table = dr.ravel(mi.Vector4f(mean.x, mean.y, mean.z, 0))
        dr.eval(table)
        return cls(sphere, table, CosineTable.of(_weights(integral)))

    def lookup(self, shading: ShadingFrame) -> tuple[mi.Color3f, mi.Color3f]:
        """Weighted radiance and weight of the wide Gaussians, one surface a lane; docs/method.md, eq. 37."""
        # ---- The three nodes around the view ----
        n, v = shading.n, shading.to_world(shading.v)
        mirrored = 2 * dr.dot(n, v) * n - v
        nodes = self.sphere.surrounding(v)
        views = [self.sphere.direction(node) for node in nodes]
        # ---- Mean radiance at the normal that mirrors each node's view into the same direction, cosine-weighted ----
        light, total = mi.Color3f(0), mi.Float(0)
        for node, view, share in zip(nodes, views, gnomonic_weights(v, *views), strict=True):
            half = mirrored + view
            normal = half * dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-12))
            trusted = share * dr.maximum(dr.dot(normal, view), _LEAST_CONFIDENCE)
            light += trusted * self._at(node, frame_of(view).T @ normal)
            total += trusted
        # ---- Weight at the true angle ----
        weight = self.weight.at(shading.cosine)
        weighing = mi.Color3f(weight.x, weight.y, weight.z)
        return light * (1 / total) * weighing, weighing

    def _at(self, node: mi.UInt32, local: mi.Vector3f) -> mi.Color3f:
        """Mean radiance at a normal in a node's frame, bilinear on its polar grid."""
        first = node * NODES
        (mean,) = interpolated(local, lambda index: dr.gather(mi.Vector4f, self.light, first + index))
        return mi.Color3f(mean.x, mean.y, mean.z)


def _weights(integral: LobeIntegral) -> NDArray[np.float64]:
    """Weight of the wide Gaussians at the cosines of a `CosineTable`, shape (nodes, 3)."""
    cosine = mi.Float(cosines().astype(np.float32))
    n = mi.Vector3f(dr.sqrt(dr.maximum(1 - cosine * cosine, 0)), 0, cosine)
    _, weight = integral.wide_light(ShadingFrame.of(n, mi.Vector3f(0, 0, 1)))
    return np.asarray(np.array(weight, dtype=np.float64).T)

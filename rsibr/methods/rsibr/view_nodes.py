"""Wide parts of a lobe, integrated once at nodes over the sphere of views: what `rsibr` evaluates single points with.

The quadrature over a wide Gaussian takes most of the time of `rsibr-fine`, and its result varies slowly with normal and
view. So it is tabulated: for each of 162 views, an icosphere's, on a polar grid of normals. A pair (n, v) is looked up
in the three nodes around v, each at the normal that mirrors that node's view into the same direction, and blended by
gnomonic weights. What is tabulated is the mean light, light over weight; the weight itself depends on the angle between
normal and view alone and has a table of its own.
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
"""Of the icosphere of view nodes: 162 of them, 18° apart."""

_LEAST_CONFIDENCE = 1e-4  # of a node that sees the surface at its horizon


@dataclass(eq=False)
class ViewNodes:
    """Mean light of the wide Gaussians of one lobe.

    Attributes
    ----------
    sphere : ViewSphere
        The view nodes.
    light : mi.Float
        For each view node and each normal of its polar grid the mean light [W sr⁻¹ m⁻²], RGB and a zero, flat.
    weight : CosineTable
        Weight of the wide Gaussians over cos θ.
    """

    sphere: ViewSphere
    light: mi.Float
    weight: CosineTable

    @classmethod
    def of(cls, integral: LobeIntegral) -> ViewNodes:
        """Integrate the wide part of a lobe at all nodes."""
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
        """Light and weight of the wide Gaussians, one surface a lane; see `LobeIntegral.radiance`."""
        n, v = shading.n, shading.to_world(shading.v)
        mirrored = 2 * dr.dot(n, v) * n - v
        nodes = self.sphere.surrounding(v)
        views = [self.sphere.direction(node) for node in nodes]
        light, total = mi.Color3f(0), mi.Float(0)
        for node, view, share in zip(nodes, views, gnomonic_weights(v, *views), strict=True):
            # The normal that mirrors the node's view into the same direction; trusted by its cosine
            half = mirrored + view
            normal = half * dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-12))
            trusted = share * dr.maximum(dr.dot(normal, view), _LEAST_CONFIDENCE)
            light += trusted * self._at(node, frame_of(view).T @ normal)
            total += trusted
        weight = self.weight.at(shading.cosine)
        weighing = mi.Color3f(weight.x, weight.y, weight.z)
        return light * (1 / total) * weighing, weighing

    def _at(self, node: mi.UInt32, local: mi.Vector3f) -> mi.Color3f:
        """Mean light at a normal in a node's frame, bilinear on its grid."""
        first = node * NODES
        (mean,) = interpolated(local, lambda index: dr.gather(mi.Vector4f, self.light, first + index))
        return mi.Color3f(mean.x, mean.y, mean.z)


def _weights(integral: LobeIntegral) -> NDArray[np.float64]:
    """Weight of the wide Gaussians at the cosines of a `CosineTable`, shape (nodes, 3)."""
    cosine = mi.Float(cosines().astype(np.float32))
    n = mi.Vector3f(dr.sqrt(dr.maximum(1 - cosine * cosine, 0)), 0, cosine)
    _, weight = integral.wide_light(ShadingFrame.of(n, mi.Vector3f(0, 0, 1)))
    return np.asarray(np.array(weight, dtype=np.float64).T)

"""Light of the wide Gaussians for single pairs of normal and view, from tables at a few hundred views.

The polar grids of 642 views (the vertices of an icosphere) are made once. A pair (n, v) is looked up at the three nodes
around v, each at the normal that mirrors the node's view into the same direction, and blended by gnomonic weights. The
grids hold mean light; the share in the albedo depends on the angle between normal and view alone. See docs/method.md,
section 9.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.geometry.frame import frame_of
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import Sphere, icosphere
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.frozen import Frozen
from rsibr.methods.rsibr.half_vector_pyramid import HalfVectorPyramid
from rsibr.methods.rsibr.polar_grid import NODES, interpolated
from rsibr.methods.rsibr.wide_light import WideLight

SUBDIVISION = 3
"""Subdivision of the icosphere of view nodes: 642 nodes, 8° to 9° apart."""

_LEAST_CONFIDENCE = 1e-4  # minimum cosine of a node's normal, reached at the node's horizon


@dataclass(eq=False)
class ViewNodes:
    """Mean light of the wide Gaussians of a material at all view nodes.

    Attributes
    ----------
    sphere : Sphere
        View nodes.
    light : mi.Float
        Mean light [W sr⁻¹ m⁻²] for each view node and each normal of its polar grid, RGB0, flat (eq. 36).
    wide : WideLight
        The Gaussians.
    """

    sphere: Sphere
    light: mi.Float
    wide: WideLight

    @classmethod
    def of(cls, wide: WideLight, environment: EnvironmentPyramid) -> ViewNodes:
        """Gather the light at all nodes."""
        views = icosphere(SUBDIVISION)
        sphere, light = views.on_device, dr.zeros(mi.Float, 4 * NODES * len(views))

        def nodes(wide: WideLight, environment: EnvironmentPyramid, sphere: Sphere, view: mi.UInt32) -> mi.Float:
            frame = frame_of(sphere.direction(view))
            dr.eval(frame)
            return wide.grid(HalfVectorPyramid.of(frame, environment)).nodes

        gathered = Frozen(nodes)
        for k in range(len(views)):
            found = gathered(wide, environment, sphere, dr.opaque(mi.UInt32, k))
            dr.scatter(light, found, dr.arange(mi.UInt32, 4 * NODES) + dr.opaque(mi.UInt32, 4 * NODES * k))
            dr.eval(light)
        return cls(sphere, light, wide)

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²] of the wide Gaussians, one surface a lane; docs/method.md, eq. 37."""
        # ---- The three nodes around the view ----
        mirrored = 2 * dr.dot(n, v) * n - v
        nodes = self.sphere.surrounding(v)
        views = [self.sphere.direction(node) for node in nodes]
        # ---- Mean light at the normal that mirrors each node's view into the same direction, cosine-weighted ----
        light, total = mi.Color3f(0), mi.Float(0)
        for node, view, share in zip(nodes, views, gnomonic_weights(v, *views), strict=True):
            half = mirrored + view
            normal = half * dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-12))
            trusted = share * dr.maximum(dr.dot(normal, view), _LEAST_CONFIDENCE)
            light += trusted * interpolated(self.light, frame_of(view).T @ normal, node * NODES)
            total += trusted
        return self.wide.share.colour(cosine) * light / total

"""What every method offers: radiance for a normal and a view, what it costs, and a fast path for whole maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.sphere_map import normal_from_disk, texel_centres
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.reconstruct.blend import Mix, Mixture
from rsibr.reconstruct.mesh import DiskMesh, mesh_warp
from rsibr.reconstruct.sources import SourceMaps
from rsibr.reconstruct.warp import LEAST_CONFIDENCE, Warp


@dataclass(frozen=True)
class Cost:
    """What a method costs before the first lookup.

    Attributes
    ----------
    bake_seconds : float
        Wall time of the bake that it reads.
    bytes : int
        Size of the maps that it reads, as stored.
    """

    bake_seconds: float
    bytes: int


@dataclass(eq=False)
class Method:
    """Warp the stored maps to the new view, texel by texel, and blend them.

    Attributes
    ----------
    name : str
        The method's name on the command line.
    viewpoints : Viewpoints
        Stored directions and triangles.
    sources : SourceMaps
        Stored maps.
    mix : Mix
        Which maps, with what weight.
    warp : Warp
        Where to look in each.
    cost : Cost
        What was spent before.
    """

    name: str
    viewpoints: Viewpoints
    sources: SourceMaps
    mix: Mix
    warp: Warp
    cost: Cost
    _kernels: dict[int, Callable[..., mi.Color3f]] = field(default_factory=dict, init=False, repr=False)

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` off surfaces with normal `n`.

        Parameters
        ----------
        n, v : mi.Vector3f
            Unit normals and unit view directions in world coordinates, one a lane, n·v ≥ 0.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²], scene-linear Rec.709.
        """
        mixture = self.mix(self.viewpoints, self.sources, v)
        looked_up = [self.warp(stored, n, v) for stored in mixture.views]
        return _blended(self.sources, mixture, looked_up, mi.Bool(True))

    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.Color3f:
        """Radiance of a whole sphere map, not yet waited for.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Columns x, y, z of the map's frame; z is the view direction.
        resolution : int
            Texels a side.

        Returns
        -------
        mi.Color3f
            Radiance of resolution² texels, row-major from the top left; zero outside the disk.

        Notes
        -----
        The view's sources and weights are found once, in a kernel of one lane; what changes from view to view is
        opaque to the kernels, so that nothing is compiled anew. They are not frozen (`dr.freeze`): it saved half a
        millisecond of tracing, and aborts the process where an array is freed while it records.
        """
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        mixture = self.mix(self.viewpoints, self.sources, _view_of(matrix))
        dr.eval(mixture)
        if resolution not in self._kernels:
            self._kernels[resolution] = self._map_kernel(resolution)
        return self._kernels[resolution](self.sources, mixture, matrix)

    def _map_kernel(self, resolution: int) -> Callable[[SourceMaps, Mixture, mi.Matrix3f], mi.Color3f]:
        def texels(sources: SourceMaps, mixture: Mixture, matrix: mi.Matrix3f) -> mi.Color3f:
            p = texel_centres(resolution)
            n, v = matrix @ normal_from_disk(p), _view_of(matrix)
            looked_up = [self.warp(stored, n, v) for stored in mixture.views]
            return _blended(sources, mixture, looked_up, _touches_disk(p, resolution))

        return texels


@dataclass(eq=False)
class MeshMethod(Method):
    """The same, with the warp computed at the vertices of a tessellated disk only; Cabral et al. (1999), section 3.3.

    Attributes
    ----------
    mesh : DiskMesh
        The tessellation.
    """

    mesh: DiskMesh = field(default_factory=DiskMesh)

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` off surfaces with normal `n`: `Method.eval`, through the mesh."""
        mixture = self.mix(self.viewpoints, self.sources, v)
        warp = mesh_warp(self.mesh, self.warp)
        return _blended(self.sources, mixture, [warp(stored, n, v) for stored in mixture.views], mi.Bool(True))

    def _map_kernel(self, resolution: int) -> Callable[[SourceMaps, Mixture, mi.Matrix3f], mi.Color3f]:
        # Which triangle a texel lies in does not change with the view: it is found once a resolution
        p = texel_centres(resolution)
        reached = _touches_disk(p, resolution)
        corner, share = self.mesh.corners(p)
        dr.eval(corner, share, reached)

        def at_vertices(mixture: Mixture, matrix: mi.Matrix3f) -> list[mi.Float]:
            vertex = self.mesh.vertex(dr.arange(mi.UInt32, self.mesh.vertex_count))
            n, v = matrix @ normal_from_disk(vertex), _view_of(matrix)
            return [_packed(*self.warp(stored, n, v)) for stored in mixture.views]

        def between(
            sources: SourceMaps,
            mixture: Mixture,
            vertices: list[mi.Float],
            corner: mi.Vector3u,
            share: mi.Vector3f,
            reached: mi.Bool,
        ) -> mi.Color3f:
            looked_up = [_interpolated(packed, corner, share, reached) for packed in vertices]
            return _blended(sources, mixture, looked_up, reached)

        def texels(sources: SourceMaps, mixture: Mixture, matrix: mi.Matrix3f) -> mi.Color3f:
            return between(sources, mixture, at_vertices(mixture, matrix), corner, share, reached)

        return texels


def _blended(
    sources: SourceMaps, mixture: Mixture, looked_up: list[tuple[mi.Point2f, mi.Float]], active: mi.Bool
) -> mi.Color3f:
    """Σ w_i c_i S_i(p_i) / Σ w_i c_i: a weight fades where its source is not to be trusted."""
    radiance, total = mi.Color3f(0), mi.Float(0)
    for stored, weight, (p, confidence) in zip(mixture.views, mixture.weights, looked_up, strict=True):
        trusted = weight * confidence
        radiance += trusted * sources.fetch(stored.index, p, active)
        total += trusted
    return radiance / total


def _view_of(matrix: mi.Matrix3f) -> mi.Vector3f:
    return mi.Vector3f(matrix[0, 2], matrix[1, 2], matrix[2, 2])


def _touches_disk(p: mi.Point2f, resolution: int) -> mi.Bool:
    """Whether a texel with centre p may touch the disk: it reaches √2/N beyond its centre."""
    return dr.squared_norm(p) < (1 + np.sqrt(2) / resolution) ** 2


def _packed(p: mi.Point2f, confidence: mi.Float) -> mi.Float:
    return dr.ravel(mi.Vector4f(p.x, p.y, confidence, 0))


def _interpolated(packed: mi.Float, corner: Any, share: Any, active: mi.Bool) -> tuple[mi.Point2f, mi.Float]:
    at = [dr.gather(mi.Vector4f, packed, index, active) for index in corner]
    mean = share.x * at[0] + share.y * at[1] + share.z * at[2]
    return mi.Point2f(mean.x, mean.y), dr.clip(mean.z, LEAST_CONFIDENCE, 1)

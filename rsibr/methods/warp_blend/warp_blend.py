"""Warp the stored maps to the new view and blend them; the base of all methods that look up stored maps."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.frame import frame_of
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centre, tiled_texels, within_disk
from rsibr.geometry.viewpoints import Sphere, Viewpoints
from rsibr.methods.frozen import Frozen
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of
from rsibr.methods.protocol import FREE, Cost
from rsibr.methods.warp_blend.blend import Mix, Mixture
from rsibr.methods.warp_blend.disk_mesh import DiskMesh, MeshWarp
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import LEAST_CONFIDENCE, Warp, WarpKind


@dataclass(eq=False, repr=False)
class WarpBlend:
    """Warp the stored maps to the new view, texel by texel, and blend them.

    Attributes
    ----------
    name : str
        Name on the command line.
    viewpoints : Viewpoints
        Stored directions and triangles.
    sources : SourceMaps
        Stored maps.
    mix : Mix
        Selects the stored views of a new view, with weights.
    warp : WarpKind
        Kind of the warp to each of them.
    cost : Cost
        Cost before the first lookup. Not a field of the dataclass, because a change of it would make a new recording
        of the kernels.
    """

    name: str
    viewpoints: Viewpoints
    sources: SourceMaps
    mix: Mix
    warp: WarpKind
    _sphere: Sphere = field(init=False, repr=False)
    _frozen: Frozen = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.cost: Cost = FREE
        self._sphere = self.viewpoints.on_device
        self._frozen = Frozen(_image)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        mixture, warps = self._toward_points(v)
        return blended(self.sources, mixture, [warp(n) for warp in warps])

    @backend.in_session
    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """Radiance of a whole sphere map, asynchronously; see `Method.map`.

        Notes
        -----
        Sources, weights and warps of the view are computed once, in a kernel of one lane. From the second view on
        nothing is traced or compiled: recorded kernels are launched again, see `Frozen`.
        """
        self._prepare(resolution)
        columns = mi.Float(frame.T.ravel().tolist())
        return mi.TensorXf(self._frozen(self, columns, resolution), (resolution, resolution, 4))

    def _prepare(self, resolution: int) -> None:
        """Make the arrays that depend on the resolution; none by default."""

    @contextmanager
    def _preparing(self) -> Iterator[None]:
        """Add the time of the block to the preparation time."""
        start = time.perf_counter()
        yield
        backend.synchronize()
        self.cost = self.cost.preparing(time.perf_counter() - start)

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """Trace the texels of a map, row-major RGBA, flat; `columns` holds the frame's columns as nine floats."""
        mixture, warps = self._toward(frame_from(columns))
        dr.eval(mixture, warps)
        texel = tiled_texels(resolution)
        return laid_out(self._texels(texel, resolution, mixture, warps), texel, resolution)

    def _toward(self, frame: mi.Matrix3f) -> tuple[Mixture, Sequence[Warp]]:
        """Sources of the view of `frame`, and the warps to them."""
        mixture = self.mix(self._sphere, self.sources, view_of(frame))
        return mixture, [self.warp.between(stored, frame) for stored in mixture.views]

    def _toward_points(self, v: mi.Vector3f) -> tuple[Mixture, Sequence[Warp]]:
        """Sources of views in world coordinates, one a lane, and the warps to them."""
        mixture = self.mix(self._sphere, self.sources, v)
        return mixture, [self.warp.at(stored, v) for stored in mixture.views]

    def _texels(self, texel: mi.UInt32, resolution: int, mixture: Mixture, warps: Sequence[Warp]) -> mi.Vector4f:
        def shaded(n: mi.Vector3f) -> mi.Vector4f:
            return as_rgba(blended(self.sources, mixture, [warp(n) for warp in warps]))

        p = texel_centre(texel, resolution)
        return dr.if_stmt((normal_from_disk(p),), touches_disk(p, resolution), shaded, lambda _: mi.Vector4f(0))


@dataclass(eq=False, repr=False)
class MeshWarpBlend(WarpBlend):
    """`WarpBlend` with the warp evaluated only at the vertices of a disk mesh; Cabral et al. (1999), section 3.3.

    Attributes
    ----------
    mesh : DiskMesh
        Tessellation of the disk.
    """

    mesh: DiskMesh = field(default_factory=DiskMesh)
    _corners: tuple[Any, ...] = field(default=(), init=False, repr=False)

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`, through the mesh; see `Method.eval`."""
        frame = frame_of(v)
        mixture, warps = self._toward(frame)
        local = frame.T @ n
        return blended(self.sources, mixture, [MeshWarp(self.mesh, warp)(local) for warp in warps])

    def __post_init__(self) -> None:
        super().__post_init__()
        # The triangle of a texel does not depend on the view. Not a field: a recording must only see the corners of
        # its own resolution
        self._corners_of: dict[int, tuple[Any, Any]] = {}

    def _prepare(self, resolution: int) -> None:
        if resolution not in self._corners_of:
            with self._preparing():
                self._corners_of[resolution] = self.mesh.corners(texel_centre(tiled_texels(resolution), resolution))
                dr.eval(self._corners_of[resolution])
        self._corners = self._corners_of[resolution]

    def _texels(self, texel: mi.UInt32, resolution: int, mixture: Mixture, warps: Sequence[Warp]) -> mi.Vector4f:
        p = texel_centre(texel, resolution)
        n = normal_from_disk(self.mesh.vertex(dr.arange(mi.UInt32, self.mesh.vertex_count)))
        vertices = [_packed(*warp(n)) for warp in warps]
        dr.eval(vertices)

        def shaded(corner: mi.Vector3u, share: mi.Vector3f) -> mi.Vector4f:
            looked_up = [_interpolated(packed, corner, share) for packed in vertices]
            return as_rgba(blended(self.sources, mixture, looked_up))

        return dr.if_stmt(self._corners, touches_disk(p, resolution), shaded, lambda _corner, _share: mi.Vector4f(0))


def blended(sources: SourceMaps, mixture: Mixture, looked_up: list[tuple[mi.Point2f, mi.Float]]) -> mi.Color3f:
    """Weighted mean of the sources, Σ w_i c_i S_i(p_i) / Σ w_i c_i, with the confidences c_i of the warps."""
    radiance, total = mi.Color3f(0), mi.Float(0)
    for stored, weight, (p, confidence) in zip(mixture.views, mixture.weights, looked_up, strict=True):
        trusted = weight * confidence
        radiance += trusted * sources.fetch(stored.index, p)
        total += trusted
    return radiance * (1 / total)


def _image(method: WarpBlend, columns: mi.Float, resolution: int) -> mi.Float:
    # A free function, so that `Frozen` holds no reference to the method and the method can be released
    return method.image(columns, resolution)


def _packed(p: mi.Point2f, confidence: mi.Float) -> mi.Float:
    return dr.ravel(mi.Vector4f(p.x, p.y, confidence, 0))


def _interpolated(packed: mi.Float, corner: mi.Vector3u, share: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
    at = [dr.gather(mi.Vector4f, packed, index) for index in corner]
    mean = share.x * at[0] + share.y * at[1] + share.z * at[2]
    return within_disk(mi.Point2f(mean.x, mean.y)), dr.maximum(mean.z, LEAST_CONFIDENCE)

"""What every method offers: radiance for a normal and a view, what it costs, and a fast path for whole maps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.frame import frame_of, from_columns
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centre, tiled_texels, within_disk
from rsibr.geometry.viewpoints import Viewpoints, ViewSphere
from rsibr.methods.frozen import Frozen
from rsibr.methods.warp_blend.blend import Mix, Mixture
from rsibr.methods.warp_blend.disk_mesh import DiskMesh, MeshWarp
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import LEAST_CONFIDENCE, Warp, WarpBetween


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
    warp : WarpBetween
        Where to look in each.
    cost : Cost
        What was spent before.
    """

    name: str
    viewpoints: Viewpoints
    sources: SourceMaps
    mix: Mix
    warp: WarpBetween
    cost: Cost
    _sphere: ViewSphere = field(init=False, repr=False)
    _replayed: Frozen = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._sphere = self.viewpoints.on_device
        self._replayed = Frozen(_image)

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
        frame = frame_of(v)
        mixture, warps = self._toward(frame)
        local = frame.T @ n
        return _blended(self.sources, mixture, [warp(local) for warp in warps])

    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """Radiance of a whole sphere map, not yet waited for.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Columns x, y, z of the map's frame; z is the view direction.
        resolution : int
            Texels a side.

        Returns
        -------
        mi.TensorXf
            RGBA of shape (resolution, resolution, 4), row 0 at the top: radiance, and 1 where a texel may touch the
            disk; zero elsewhere.

        Notes
        -----
        The view's sources, weights and warps are found once, in a kernel of one lane. Nothing is traced from one view
        to the next, and nothing compiled: the kernels of the first are launched again, see `Frozen`.
        """
        self._prepare(resolution)
        columns = mi.Float(frame.T.ravel().tolist())
        return mi.TensorXf(self._replayed(self, columns, resolution), (resolution, resolution, 4))

    def _prepare(self, resolution: int) -> None:
        """Put on the device what maps of this resolution need beside the method's own arrays."""

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """The texels of a map, traced: row-major RGBA, flat; `columns` are the nine floats of the frame, x, y, z."""
        mixture, warps = self._toward(frame_from(columns))
        dr.eval(mixture, warps)
        texel = tiled_texels(resolution)
        return laid_out(self._texels(texel, resolution, mixture, warps), texel, resolution)

    def _toward(self, frame: mi.Matrix3f) -> tuple[Mixture, list[Warp]]:
        """The sources of the view that `frame` looks from, and the warps to them."""
        mixture = self.mix(self._sphere, self.sources, mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]))
        return mixture, [self.warp(stored, frame) for stored in mixture.views]

    def _texels(self, texel: mi.UInt32, resolution: int, mixture: Mixture, warps: list[Warp]) -> mi.Vector4f:
        def blended(n: mi.Vector3f) -> mi.Vector4f:
            return as_rgba(_blended(self.sources, mixture, [warp(n) for warp in warps]))

        p = texel_centre(texel, resolution)
        return dr.if_stmt((normal_from_disk(p),), touches_disk(p, resolution), blended, lambda _: mi.Vector4f(0))


@dataclass(eq=False)
class MeshMethod(Method):
    """The same, with the warp computed at the vertices of a tessellated disk only; Cabral et al. (1999), section 3.3.

    Attributes
    ----------
    mesh : DiskMesh
        The tessellation.
    """

    mesh: DiskMesh = field(default_factory=DiskMesh)
    _corners: tuple[Any, ...] = field(default=(), init=False, repr=False)

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` off surfaces with normal `n`: `Method.eval`, through the mesh."""
        frame = frame_of(v)
        mixture, warps = self._toward(frame)
        local = frame.T @ n
        return _blended(self.sources, mixture, [MeshWarp(self.mesh, warp)(local) for warp in warps])

    def __post_init__(self) -> None:
        super().__post_init__()
        # Which triangle a texel lies in does not change with the view. Not a field: a recording knows the corners of
        # its own resolution only
        self._corners_of: dict[int, tuple[Any, Any]] = {}

    def _prepare(self, resolution: int) -> None:
        if resolution not in self._corners_of:
            self._corners_of[resolution] = self.mesh.corners(texel_centre(tiled_texels(resolution), resolution))
            dr.eval(self._corners_of[resolution])
        self._corners = self._corners_of[resolution]

    def _texels(self, texel: mi.UInt32, resolution: int, mixture: Mixture, warps: list[Warp]) -> mi.Vector4f:
        p = texel_centre(texel, resolution)
        n = normal_from_disk(self.mesh.vertex(dr.arange(mi.UInt32, self.mesh.vertex_count)))
        vertices = [_packed(*warp(n)) for warp in warps]
        dr.eval(vertices)

        def blended(corner: mi.Vector3u, share: mi.Vector3f) -> mi.Vector4f:
            looked_up = [_interpolated(packed, corner, share) for packed in vertices]
            return as_rgba(_blended(self.sources, mixture, looked_up))

        return dr.if_stmt(self._corners, touches_disk(p, resolution), blended, lambda _corner, _share: mi.Vector4f(0))


def _image(method: Method, columns: mi.Float, resolution: int) -> mi.Float:
    # A function of its own: what `Frozen` keeps is the recording alone, and the method goes with its last user
    return method.image(columns, resolution)


def _blended(sources: SourceMaps, mixture: Mixture, looked_up: list[tuple[mi.Point2f, mi.Float]]) -> mi.Color3f:
    """Σ w_i c_i S_i(p_i) / Σ w_i c_i: a weight fades where its source is not to be trusted."""
    radiance, total = mi.Color3f(0), mi.Float(0)
    for stored, weight, (p, confidence) in zip(mixture.views, mixture.weights, looked_up, strict=True):
        trusted = weight * confidence
        radiance += trusted * sources.fetch(stored.index, p)
        total += trusted
    return radiance * (1 / total)


def frame_from(columns: mi.Float) -> mi.Matrix3f:
    """Frame with the columns x, y and z that stand in nine floats one behind the other."""
    return from_columns(*(dr.gather(mi.Vector3f, columns, mi.UInt32(axis)) for axis in range(3)))


def laid_out(radiance: mi.Vector4f, texel: mi.UInt32, resolution: int) -> mi.Float:
    """Texels worked through in any order as an image, row-major, flat.

    With four channels a texel is one packet, written whole.
    """
    image = dr.empty(mi.Float, 4 * resolution**2)
    dr.scatter(image, radiance, texel)
    return image


def as_rgba(radiance: mi.Color3f) -> mi.Vector4f:
    """Radiance with 1 behind it: the texel is one that may touch the disk."""
    return mi.Vector4f(radiance.x, radiance.y, radiance.z, 1)


def touches_disk(p: mi.Point2f, resolution: int) -> mi.Bool:
    """Whether a texel with centre p may touch the disk: it reaches √2/N beyond its centre."""
    return dr.squared_norm(p) < (1 + np.sqrt(2) / resolution) ** 2


def _packed(p: mi.Point2f, confidence: mi.Float) -> mi.Float:
    return dr.ravel(mi.Vector4f(p.x, p.y, confidence, 0))


def _interpolated(packed: mi.Float, corner: mi.Vector3u, share: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
    at = [dr.gather(mi.Vector4f, packed, index) for index in corner]
    mean = share.x * at[0] + share.y * at[1] + share.z * at[2]
    return within_disk(mi.Point2f(mean.x, mean.y)), dr.maximum(mean.z, LEAST_CONFIDENCE)

"""Lobes warped separately: each with its own warp, normalised by its directional albedo, footprint corrected.

A step between `cabral1999` and `rsibr` that needs no environment. An unlisted method, available by name: `lobe-warp`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.frame import frame_of
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centre, tiled_texels
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import Sphere
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.lobe_albedo import LobeAlbedo
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.warp_blend.blend import Mixture, triangle_mix
from rsibr.methods.warp_blend.footprint_covariance import MOST_TAKEN, MirrorFootprint, tap_angle
from rsibr.methods.warp_blend.source_maps import SourceMaps, StoredView
from rsibr.methods.warp_blend.warp import LEAST_CONFIDENCE, MirrorWarp, NormalWarp
from rsibr.methods.warp_blend.warp_blend import WarpBlend

Toward = tuple[Mixture, "list[LobeWarps]"]
"""Stored views around a new one, and the warps to them."""

_LEAST_ALPHA = 0.004  # roughness below which a lobe's footprint is smaller than a texel of any map


@dataclass
class LobeMaps:
    """Stored maps of one lobe.

    Attributes
    ----------
    sources : SourceMaps
        Radiance from every stored view.
    albedo : LobeAlbedo
        Directional albedo.
    alpha : mi.Float
        Roughness α.
    is_diffuse, is_sharp : bool
        Whether the lobe depends on the normal alone; whether its footprint is smaller than a texel.
    """

    sources: SourceMaps
    albedo: LobeAlbedo
    alpha: mi.Float
    is_diffuse: bool
    is_sharp: bool

    @classmethod
    def of(cls, sources: SourceMaps, alpha: float, albedo: NDArray[np.float64]) -> LobeMaps:
        """Put a lobe on the device: maps, roughness, and albedo table of shape (NODES, 3)."""
        return cls(
            sources, LobeAlbedo.of(albedo), dr.opaque(mi.Float, max(alpha, 0.0)), alpha == 0.0, alpha < _LEAST_ALPHA
        )


@dataclass
class LobeWarps:
    """Both warps to a stored view.

    Attributes
    ----------
    mirror : MirrorWarp
        Warp of glossy lobes.
    normal : NormalWarp
        Warp of matte lobes.
    """

    mirror: MirrorWarp
    normal: NormalWarp

    @classmethod
    def between(cls, stored: StoredView, frame: mi.Matrix3f) -> LobeWarps:
        """Make the warps from the destination's `frame`, columns x, y, v, to a stored view."""
        return cls(MirrorWarp.between(stored, frame), NormalWarp.between(stored, frame))

    def point(self, n: mi.Vector3f, is_diffuse: bool) -> mi.Point2f:
        """Point of the stored map for the normal `n`, by the warp of the lobe."""
        return (self.normal if is_diffuse else self.mirror)(n)[0]


@dataclass
class LobeGroup:
    """Lobes that are stored in the same views, hence share mixture and warps.

    Attributes
    ----------
    sphere : Sphere
        Views that store them.
    lobes : list of LobeMaps
        At least one.
    """

    sphere: Sphere
    lobes: list[LobeMaps]


@dataclass(frozen=True)
class Corrections:
    """Corrections beyond warping, each optional, so that a study can measure its gain and its cost.

    Attributes
    ----------
    albedo : bool
        Divide each source by its directional albedo and multiply by the destination's: Fresnel and shadowing depend on
        the surface angle, the environment on the direction.
    moments : bool
        Correct the footprint of glossy lobes to second order.
    """

    albedo: bool = True
    moments: bool = True


@dataclass(eq=False, repr=False)
class LobeWarpMethod(WarpBlend):
    """Σ_k E_k(θ_d) [Σ_i w_i c_ik S_ik(p_ik)/E_k(θ_ik)] / Σ_i w_i c_ik; DESIGN.md, "Lobes".

    Attributes
    ----------
    groups : list of LobeGroup
        Lobes, grouped by the views that store them.
    corrections : Corrections
        Corrections beyond warping.
    """

    groups: list[LobeGroup] = field(default_factory=list)
    corrections: Corrections = Corrections()

    @classmethod
    @backend.in_session
    def of(cls, inputs: MethodInputs, corrections: Corrections = Corrections()) -> LobeWarpMethod:
        """Make the method from the lobes of a bake.

        Each lobe is interpolated between the views that store a layer of it; for some lobes these are not all views.
        """
        groups: dict[int, list[LobeMaps]] = {}
        for record in inputs.lobes:
            images = [inputs.image(m, record.name) for m in inputs.stored(record.name)]
            lobe = LobeMaps.of(inputs.on_device(images), record.alpha, np.array(record.albedo))
            groups.setdefault(len(images), []).append(lobe)
        return cls(
            "lobe-warp",
            inputs.viewpoints,
            inputs.sources,
            triangle_mix(gnomonic_weights),
            MirrorWarp,
            groups=[LobeGroup(inputs.first_views(count).on_device, lobes) for count, lobes in groups.items()],
            corrections=corrections,
        )

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        frame = frame_of(v)
        return self._summed(self._toward_each(frame), frame.T @ n)

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """Texels of a map; see `WarpBlend.image`."""
        toward = self._toward_each(frame_from(columns))
        dr.eval(toward)
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)
        radiance = dr.if_stmt(
            (normal_from_disk(p),),
            touches_disk(p, resolution),
            lambda n: as_rgba(self._summed(toward, n)),
            lambda _: mi.Vector4f(0),
        )
        return laid_out(radiance, texel, resolution)

    def _toward_each(self, frame: mi.Matrix3f) -> list[Toward]:
        """Sources and warps of each group for the view of `frame`."""
        mixtures = [self.mix(group.sphere, group.lobes[0].sources, view_of(frame)) for group in self.groups]
        return [(mixture, [LobeWarps.between(stored, frame) for stored in mixture.views]) for mixture in mixtures]

    def _summed(self, toward: list[Toward], n: mi.Vector3f) -> mi.Color3f:
        radiance, footprint = mi.Color3f(0), MirrorFootprint.at(n)
        for group, (mixture, warps) in zip(self.groups, toward, strict=True):
            radiance += self._of_group(group, mixture, warps, footprint, n)
        return radiance

    def _of_group(
        self, group: LobeGroup, mixture: Mixture, warps: list[LobeWarps], footprint: MirrorFootprint, n: mi.Vector3f
    ) -> mi.Color3f:
        radiance = mi.Color3f(0)
        points = {is_diffuse: [warp.point(n, is_diffuse) for warp in warps] for is_diffuse in (False, True)}
        for lobe in group.lobes:
            total, weights = mi.Color3f(0), mi.Float(0)
            for stored, weight, warp, p in zip(
                mixture.views, mixture.weights, warps, points[lobe.is_diffuse], strict=True
            ):
                cosine = dr.sqrt(dr.maximum(1 - dr.squared_norm(p), 0))
                # Texels span more directions toward the rim: weight by the source's cosine
                trusted = weight * dr.maximum(cosine, LEAST_CONFIDENCE)
                total += trusted * self._carried(lobe, stored.index, warp.mirror, footprint, p, cosine)
                weights += trusted
            mean = total * (1 / weights)
            radiance += mean * lobe.albedo.at(n.z) if self.corrections.albedo else mean
        return radiance

    def _carried(
        self,
        lobe: LobeMaps,
        view: mi.UInt32,
        mirror: MirrorWarp,
        footprint: MirrorFootprint,
        p: mi.Point2f,
        cosine: mi.Float,
    ) -> mi.Color3f:
        """Radiance of a source with corrected footprint, divided by the source's albedo."""
        seen = lobe.sources.fetch(view, p)
        if self.corrections.moments and not (lobe.is_diffuse or lobe.is_sharp):
            seen = _footprint_corrected(lobe, view, mirror, footprint, cosine, seen)
        return seen / lobe.albedo.at(cosine) if self.corrections.albedo else seen


def _footprint_corrected(
    lobe: LobeMaps, view: mi.UInt32, mirror: MirrorWarp, footprint: MirrorFootprint, cosine: mi.Float, seen: mi.Color3f
) -> mi.Color3f:
    """Change a source's footprint to that of the destination, to second order: L + Σ sign(λ)(L₊ + L₋ − 2L)/6."""
    change = mi.Color3f(0)
    for tangent, eigenvalue in footprint.axes_toward(mirror.stored_view(), cosine):
        sine, cosine_of = dr.sincos(tap_angle(eigenvalue, lobe.alpha))
        ahead = lobe.sources.fetch(view, mirror.disk_of(footprint.r * cosine_of + tangent * sine))
        behind = lobe.sources.fetch(view, mirror.disk_of(footprint.r * cosine_of - tangent * sine))
        change += dr.sign(eigenvalue) * (ahead + behind - 2 * seen) * (1 / 6)
    return seen + dr.maximum(change, -MOST_TAKEN * seen)


@register(
    "lobe-warp",
    summary="each lobe through its own warp, its albedo and footprint corrected",
    needs=Needs(views=True, lobes=True),
    rank=45,
    listed=False,
)
def lobe_warp(inputs: MethodInputs, *, albedo: bool = True, moments: bool = True) -> LobeWarpMethod:
    """Make the method; the options are those of `Corrections`."""
    return LobeWarpMethod.of(inputs, Corrections(albedo, moments))

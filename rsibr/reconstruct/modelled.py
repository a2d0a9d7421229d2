"""The method `rsibr`: what a model of each lobe says of the new view, and what it left unsaid at the stored ones."""

from __future__ import annotations

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.bake.manifest import LobeRecord
from rsibr.effects.fit import ProxyLobe
from rsibr.effects.kernel import LobeKernel
from rsibr.geometry.frame import frame_of
from rsibr.geometry.sphere_map import normal_from_disk, texel_centre, texel_centres, tiled_texels
from rsibr.reconstruct.blend import Mixture
from rsibr.reconstruct.light_stack import LightStack
from rsibr.reconstruct.lobe_albedo import LobeAlbedo
from rsibr.reconstruct.lobe_model import LobeModel
from rsibr.reconstruct.method import Method, as_rgba, frame_from, laid_out, touches_disk
from rsibr.reconstruct.polar_grid import PolarGrid
from rsibr.reconstruct.warp import Warp

_LEAST_COSINE = 1e-6


@dataclass(eq=False)
class ModelledLobe:
    """A lobe as the method knows it.

    Attributes
    ----------
    model : LobeModel
        Its radiance over its albedo, from the light alone.
    albedo : LobeAlbedo
        Its directional albedo.
    """

    model: LobeModel
    albedo: LobeAlbedo


@dataclass(eq=False)
class ModelledMethod(Method):
    """L(n, v) ≈ P(n, v) + E(θ_d) Σ_i w_i c_i² ρ_i² R_i(p_i) / Σ_i w_i c_i², with R_i = (S_i − P_i)/E.

    P = Σ_k E_k P_k is the model of all lobes and E = Σ_k E_k their albedo. `sources` holds the residuals R_i: what the
    model leaves unsaid at the stored views, over the albedo there, so that the method is exact at these views whatever
    the model is. A residual is warped by the mirror direction. It is trusted by the cosine c_i under which its view saw
    the surface, and counts as far as the footprints of the two views overlap, ρ_i = min(c_i, c_d)/max(c_i, c_d): an
    error of the model at one angle says the less about another the more the angles differ.

    Attributes
    ----------
    lobes : list of ModelledLobe
        All lobes of the material.
    uses_maps : bool
        Whether the residuals take part; without them the method is the model alone.
    """

    lobes: list[ModelledLobe] = field(default_factory=list)
    uses_maps: bool = True

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` off surfaces with normal `n`: see `Method.eval`."""
        frame = frame_of(v)
        mixture, warps = self._toward(frame)
        local = frame.T @ n
        radiance, albedo = mi.Color3f(0), mi.Color3f(0)
        for lobe in self.lobes:
            share = lobe.albedo.at(local.z)
            radiance += share * lobe.model.radiance(n, v)
            albedo += share
        return radiance + albedo * self._residual(mixture, warps, local)

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """The texels of a map: see `Method.image`."""
        frame = frame_from(columns)
        mixture, warps = self._toward(frame)
        grids = self._grids(frame)
        dr.eval(frame, mixture, warps, grids)
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)

        def shaded(n: mi.Vector3f) -> mi.Vector4f:
            modelled, albedo = self.modelled(n, frame, grids, mi.Float(2 / resolution))
            return as_rgba(dr.maximum(modelled + albedo * self._residual(mixture, warps, n), 0))

        inside = touches_disk(p, resolution)
        radiance = dr.if_stmt((normal_from_disk(p),), inside, shaded, lambda _: mi.Vector4f(0))
        return laid_out(radiance, texel, resolution)

    def left_over(self, radiance: NDArray[np.float32], frame: NDArray[np.float64]) -> NDArray[np.float32]:
        """What a stored map says that the model does not, over the albedo.

        Parameters
        ----------
        radiance : ndarray, shape (N, N, 3)
            The map [W sr⁻¹ m⁻²].
        frame : ndarray, shape (3, 3)
            Its frame, columns x, y, v.

        Returns
        -------
        ndarray, shape (N, N, 3)
            The residual; what lies outside the disk means nothing.
        """
        resolution = len(radiance)
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        grids = self._grids(matrix)
        dr.eval(grids)
        n = normal_from_disk(texel_centres(resolution))
        modelled, albedo = self.modelled(n, matrix, grids, dr.opaque(mi.Float, 2 / resolution))
        model, share = (np.array(colour).T.reshape(radiance.shape) for colour in (modelled, albedo))
        return np.asarray((radiance - model) / share, dtype=np.float32)

    def _grids(self, frame: mi.Matrix3f) -> list[PolarGrid | None]:
        return [lobe.model.grid(frame) if lobe.model.has_grid else None for lobe in self.lobes]

    def modelled(
        self, n: mi.Vector3f, frame: mi.Matrix3f, grids: list[PolarGrid | None], spacing: mi.Float
    ) -> tuple[mi.Color3f, mi.Color3f]:
        """Radiance of all lobes that the model gives the texels of a map, and their albedo; see `LobeModel`."""
        radiance, albedo = mi.Color3f(0), mi.Color3f(0)
        for lobe, grid in zip(self.lobes, grids, strict=True):
            share = lobe.albedo.at(n.z)
            radiance += share * lobe.model.radiance_in_map(n, frame, grid, spacing)
            albedo += share
        return radiance, albedo

    def _residual(self, mixture: Mixture, warps: list[Warp], n: mi.Vector3f) -> mi.Color3f:
        """What the stored views say that the model does not, carried to the surface normal `n` of the new view."""
        if not self.uses_maps:
            return mi.Color3f(0)
        residual, total = mi.Color3f(0), mi.Float(0)
        here = dr.maximum(n.z, _LEAST_COSINE)
        for stored, weight, warp in zip(mixture.views, mixture.weights, warps, strict=True):
            p, _ = warp(n)
            there = dr.maximum(dr.sqrt(dr.maximum(1 - dr.squared_norm(p), 0)), _LEAST_COSINE)
            overlap = dr.minimum(here, there) / dr.maximum(here, there)
            trusted = weight * there * there
            residual += trusted * overlap * overlap * self.sources.fetch(stored.index, p)
            total += trusted
        return residual * (1 / total)


def modelled_lobe(record: LobeRecord, stack: LightStack, light: NDArray[np.float32]) -> ModelledLobe:
    """Put a stored lobe on the device, with its model.

    Parameters
    ----------
    record : LobeRecord
        What the bake knows of the lobe.
    stack : LightStack
        The light, blurred.
    light : ndarray, shape (R, R, 3)
        The same light, as it is.
    """
    alphas = tuple(proxy.alpha for proxy in record.proxies)
    coefficients = tuple(np.array(proxy.coefficients) for proxy in record.proxies)
    kernel = LobeKernel.of(ProxyLobe(alphas, coefficients)) if record.proxies else LobeKernel.mirror()
    return ModelledLobe(LobeModel.of(kernel, stack, light), LobeAlbedo.of(np.array(record.albedo)))

"""Prediction P plus the warped residual (stored − P): what `rsibr` and `rsibr-fine` have in common.

L(n, v) ≈ P(n, v) + E(θ) · Σ (weighted residuals of the stored views over E), see `residual_transport.py`, with the
directional albedo E of the whole material. `rsibr-fine` integrates P lobe by lobe, `rsibr` takes it from one
half-vector pyramid for the whole map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.frame import frame_of
from rsibr.geometry.projections.sphere_map import (
    covered_middle,
    normal_from_disk,
    texel_centre,
    texel_centres,
    tiled_texels,
)
from rsibr.methods.protocol import Method, as_rgba, frame_from, laid_out, touches_disk
from rsibr.methods.rsibr.lobe_albedo import LobeAlbedo
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.polar_grid import PolarGrid
from rsibr.methods.rsibr.residual_transport import carried, within_reach
from rsibr.methods.rsibr.rsibr import PrefilteredLobes
from rsibr.methods.warp_blend.blend import Mixture
from rsibr.methods.warp_blend.warp import Warp


@dataclass(eq=False)
class ResidualMethod(Method):
    """A model P of all lobes and what it left unsaid.

    Attributes
    ----------
    albedo : LobeAlbedo
        Directional albedo of the whole material; it also keeps its place where `sources` holds residuals over it.
    uses_maps : bool
        Whether the residuals take part; without them the method is the model alone.
    keeps_negatives : bool
        Whether what falls below zero is kept, and residuals uncut: by a part of a sum, for only so do the parts add up,
        and in spectral maps, where a colour outside Rec.709 is no mistake.
    """

    albedo: LobeAlbedo = field(kw_only=True)
    uses_maps: bool = True
    keeps_negatives: bool = False

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """The texels of a map: see `Method.image`."""
        frame = frame_from(columns)
        toward = self._toward(frame) if self.uses_maps else None
        gathered = self._gathered(frame, resolution)
        dr.eval(frame, toward, gathered)
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)

        def shaded(n: mi.Vector3f, seen: mi.Vector3f) -> mi.Vector4f:
            radiance = self._modelled(seen, frame, gathered, resolution)
            if toward is not None:
                radiance += self._carried(toward, n, self.albedo.at(seen.z), radiance)
            return as_rgba(self._finished(radiance))

        inside = touches_disk(p, resolution)
        normals = normal_from_disk(p), normal_from_disk(covered_middle(p, resolution))
        radiance = dr.if_stmt(normals, inside, shaded, lambda _n, _seen: mi.Vector4f(0))
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
        self._prepare(resolution)
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        n = normal_from_disk(covered_middle(texel_centres(resolution), resolution))
        gathered = self._gathered(matrix, resolution)
        dr.eval(gathered)
        modelled, albedo = self._modelled(n, matrix, gathered, resolution), self.albedo.at(n.z)
        model, share = (np.array(colour).T.reshape(radiance.shape) for colour in (modelled, albedo))
        return np.asarray((radiance - model) / share, dtype=np.float32)

    def _carried(
        self, toward: tuple[Mixture, list[Warp]], n: mi.Vector3f, albedo: mi.Color3f, modelled: mi.Color3f
    ) -> mi.Color3f:
        residual = albedo * carried(self.sources, *toward, n)
        return residual if self.keeps_negatives else within_reach(residual, modelled, toward[0])

    def _finished(self, radiance: mi.Color3f) -> mi.Color3f:
        return radiance if self.keeps_negatives else dr.maximum(radiance, 0)

    def _gathered(self, frame: mi.Matrix3f, resolution: int) -> Any:
        """What the model of a whole map can know before its texels; arrays, to be evaluated."""
        raise NotImplementedError

    def _modelled(self, n: mi.Vector3f, frame: mi.Matrix3f, gathered: Any, resolution: int) -> mi.Color3f:
        """Radiance that the model gives the texels of a map with the normals `n` in the map's frame."""
        raise NotImplementedError


@dataclass(eq=False)
class FineMethod(ResidualMethod):
    """`rsibr-fine`: each lobe gathers its own light, by as many lookups as its shape asks for.

    Attributes
    ----------
    lobes : list of (LobeIntegral, LobeAlbedo)
        Model of each lobe, and its share of the albedo.
    """

    lobes: list[tuple[LobeIntegral, LobeAlbedo]] = field(default_factory=list)

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` off surfaces with normal `n`: see `Method.eval`."""
        frame = frame_of(v)
        local = frame.T @ n
        radiance = mi.Color3f(0)
        for model, albedo in self.lobes:
            radiance += albedo.at(local.z) * model.radiance(n, v)
        if self.uses_maps:
            radiance += self._carried(self._toward(frame), local, self.albedo.at(local.z), radiance)
        return self._finished(radiance)

    def _gathered(self, frame: mi.Matrix3f, resolution: int) -> list[PolarGrid | None]:  # noqa: ARG002
        return [model.grid(frame) if model.has_grid else None for model, _ in self.lobes]

    def _modelled(
        self, n: mi.Vector3f, frame: mi.Matrix3f, gathered: list[PolarGrid | None], resolution: int
    ) -> mi.Color3f:
        radiance = mi.Color3f(0)
        for (model, albedo), grid in zip(self.lobes, gathered, strict=True):
            radiance += albedo.at(n.z) * model.radiance_in_map(n, frame, grid, mi.Float(2 / resolution))
        return radiance


@dataclass(eq=False)
class PrefilteredMethod(ResidualMethod):
    """`rsibr`: the light that all lobes gather, for a whole map at once.

    Attributes
    ----------
    prefilter : callable
        Resolution → the lobes, prepared for maps of it.
    by_itself : callable
        The method for single pairs of normal and viewer, which no prefiltering helps: `FineMethod`.
    """

    prefilter: Callable[[int], PrefilteredLobes] = field(kw_only=True)
    by_itself: Callable[[], Method] = field(kw_only=True)
    _lobes: dict[int, PrefilteredLobes] = field(default_factory=dict, init=False, repr=False)

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` off surfaces with normal `n`: see `Method.eval`."""
        return self.by_itself().eval(n, v)

    def _prepare(self, resolution: int) -> None:
        if resolution not in self._lobes:
            self._lobes[resolution] = self.prefilter(resolution)

    def _gathered(self, frame: mi.Matrix3f, resolution: int) -> mi.Float:
        return self._lobes[resolution].gathered(frame)

    def _modelled(self, n: mi.Vector3f, frame: mi.Matrix3f, gathered: mi.Float, resolution: int) -> mi.Color3f:
        return self._lobes[resolution].radiance(n, frame, gathered, mi.Float(2 / resolution))

"""Prediction P plus the warped residual (stored − P); the base of `rsibr` and `rsibr-fine`.

P is a control variate: L(n, v) = P(n, v) + E(cos θ) · (weighted mean of the residuals R_i of the stored views), with
R_i = (S_i − P_i)/E and the directional albedo E of the whole material (docs/method.md, eqs. 32 and 33;
`residual_transport.py`). For a whole map P comes from one half-vector pyramid, for single points from integrals over
footprints. How far residuals and P are believed is learnt from the stored views (`belief.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.sphere_map import (
    covered_middle,
    normal_from_disk,
    texel_centre,
    texel_centres,
    tiled_texels,
)
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.lobe_albedo import LobeAlbedo
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of
from rsibr.methods.rsibr.belief import Belief, node_table
from rsibr.methods.rsibr.delta_light_lobes import DeltaLightLobes
from rsibr.methods.rsibr.delta_lobe import EXACT, ROUGH
from rsibr.methods.rsibr.residual_transport import clamped, trusted, warped_residual
from rsibr.methods.warp_blend.blend import WEIGHTS, Mixture, triangle_mix
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import WARPS, MirrorWarp, PointMirrorWarp, Warp
from rsibr.methods.warp_blend.warp_blend import WarpBlend, blended
from rsibr.store.map_file import MapFile


@dataclass(eq=False)
class Hedge:
    """Interpolation of the stored maps, and the weight of model and residuals against it.

    Attributes
    ----------
    interpolation : WarpBlend
        `cabral1999` on the same maps.
    weight : CosineTable
        Weight of the model by cos θ.
    """

    interpolation: WarpBlend
    weight: CosineTable

    def toward(self, frame: mi.Matrix3f) -> tuple[Mixture, Sequence[Warp]]:
        """Sources of the view of `frame`, and the warps to them."""
        return self.interpolation._toward(frame)

    def toward_points(self, v: mi.Vector3f) -> tuple[Mixture, Sequence[Warp]]:
        """Sources of single views, and the warps to them."""
        return self.interpolation._toward_points(v)

    def mixed(
        self, modelled: mi.Color3f, toward: tuple[Mixture, Sequence[Warp]], n: mi.Vector3f, cosine: mi.Float
    ) -> mi.Color3f:
        """Mixture with the interpolation at normals `n`, as the warps take them, seen under `cosine`."""
        mixture, warps = toward
        plain = blended(self.interpolation.sources, mixture, [warp(n) for warp in warps])
        return dr.lerp(plain, modelled, self.weight.colour(cosine))


@dataclass(eq=False, repr=False)
class ResidualMethod(WarpBlend):
    """Prediction P of all lobes plus the warped residuals of the stored maps.

    Attributes
    ----------
    albedo : LobeAlbedo
        Directional albedo E of the whole material; `sources` holds the residuals divided by it.
    uses_maps : bool
        Whether residuals are added; without them the result is P.
    keeps_negatives : bool
        Whether negative radiance is kept and residuals are not clamped. Needed for the part of a single lobe, so that
        the parts of all lobes add up, and in spectral maps, where colours outside Rec.709 are legitimate.
    carries_mirror : bool
        Whether residuals include the layer of a delta lobe; without it that layer is the prediction alone, because the
        noise of the stored one is large where a bright source is met by chance (docs/method.md, section 8.5).
    delta_lights : DeltaLightLobes or None
        Reflection of lights without extent; None if there are none.
    trust : CosineTable or None
        Trust in carried residuals by cos θ, see `belief.py`; None: full trust.
    believes : bool
        Whether the model is believed. Otherwise residuals are neither damped where footprints differ, nor clamped.
    hedge : Hedge or None
        The paper's interpolation, where it is mixed in.
    """

    albedo: LobeAlbedo = field(kw_only=True)
    uses_maps: bool = True
    keeps_negatives: bool = False
    carries_mirror: bool = True
    delta_lights: DeltaLightLobes | None = None
    trust: CosineTable | None = None
    believes: bool = True
    hedge: Hedge | None = None

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """Texels of a map; see `WarpBlend.image`."""
        # ---- Once a map: stored views and warps, tables of the prediction ----
        frame = frame_from(columns)
        toward = self._toward(frame) if self.uses_maps else None
        across = self.hedge.toward(frame) if self.hedge else None
        tables = self._map_tables(frame, resolution)
        dr.eval(frame, toward, across, tables)
        # ---- Each texel: prediction at the middle of its covered part, residual at its centre (section 8.4) ----
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)

        def shaded(n: mi.Vector3f, middle: mi.Vector3f) -> mi.Vector4f:
            radiance = self._whole_prediction(middle, frame, tables, resolution)
            if toward is not None:
                radiance += self._residual(toward, n, n.z, self.albedo.at(middle.z), radiance)
            if self.hedge is not None and across is not None:
                radiance = self.hedge.mixed(radiance, across, n, n.z)
            return as_rgba(self._finished(radiance))

        def black(n: mi.Vector3f, _middle: mi.Vector3f) -> mi.Vector4f:
            return mi.Vector4f(dr.minimum(n.x * n.x, 0))  # no literal: Dr.Jit 1.5 fails where both branches return one

        # ---- Skip texels outside the disk ----
        inside = touches_disk(p, resolution)
        normals = normal_from_disk(p), normal_from_disk(covered_middle(p, resolution))
        radiance = dr.if_stmt(normals, inside, shaded, black)
        return laid_out(radiance, texel, resolution)

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine, radiance = dr.dot(n, v), self._predicted_at(n, v)
        if self.delta_lights is not None:
            radiance += self.delta_lights.radiance(n, v)
        if self.uses_maps:
            radiance += self._residual(self._toward_points(v), n, cosine, self.albedo.at(cosine), radiance)
        if self.hedge is not None:
            radiance = self.hedge.mixed(radiance, self.hedge.toward_points(v), n, cosine)
        return self._finished(radiance)

    def residual_of(self, radiance: NDArray[np.float32], frame: NDArray[np.float64]) -> NDArray[np.float32]:
        """Residual of a stored map divided by the albedo: (S − P)/E; docs/method.md, eq. 32.

        Parameters
        ----------
        radiance : ndarray, shape (N, N, 3)
            Stored map S [W sr⁻¹ m⁻²]; without the layer of the delta lobe if that is not carried.
        frame : ndarray, shape (3, 3)
            Its frame, columns x, y, v.

        Returns
        -------
        ndarray, shape (N, N, 3), float32
            [W sr⁻¹ m⁻²]; values of texels outside the disk are undefined.
        """
        p, e = self.predicted_at_texels(frame, len(radiance))
        return np.asarray((radiance - p) / e, dtype=np.float32)

    def predicted_at_texels(
        self, frame: NDArray[np.float64], resolution: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Prediction P [W sr⁻¹ m⁻²] and directional albedo E of the texels of a stored map, each (N, N, 3).

        Without the delta lobe if that is not carried.
        """
        self._prepare(resolution)
        matrix = mi.Matrix3f(frame.astype(np.float32))
        dr.make_opaque(matrix)
        n = normal_from_disk(covered_middle(texel_centres(resolution), resolution))
        tables = self._map_tables(matrix, resolution)
        dr.eval(tables)
        predicted = self._whole_prediction(n, matrix, tables, resolution, self.carries_mirror)
        every = dr.zeros(mi.Color3f, resolution**2)  # a prediction of nothing is a literal zero of one lane
        p, e = (np.array(c + every).T.reshape(resolution, resolution, 3) for c in (predicted, self.albedo.at(n.z)))
        return p, e

    def _toward(self, frame: mi.Matrix3f) -> tuple[Mixture, list[MirrorWarp]]:
        mixture = self.mix(self._sphere, self.sources, view_of(frame))
        return mixture, [MirrorWarp.between(stored, frame) for stored in mixture.views]

    def _toward_points(self, v: mi.Vector3f) -> tuple[Mixture, list[PointMirrorWarp]]:
        mixture = self.mix(self._sphere, self.sources, v)
        return mixture, [MirrorWarp.at(stored, v) for stored in mixture.views]

    def _residual(
        self,
        toward: tuple[Mixture, Sequence[MirrorWarp | PointMirrorWarp]],
        n: mi.Vector3f,
        cosine: mi.Float,
        albedo: mi.Color3f,
        predicted: mi.Color3f,
    ) -> mi.Color3f:
        residual = albedo * warped_residual(self.sources, *toward, n, cosine, self.believes)
        if self.trust is not None:
            residual *= trusted(self.trust.at(cosine).x, toward[0])
        unbounded = self.keeps_negatives or not self.believes
        return residual if unbounded else clamped(residual, predicted, toward[0])

    def _whole_prediction(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: Any, resolution: int, mirror: bool = True
    ) -> mi.Color3f:
        radiance = self._predicted(n, frame, tables, resolution, mirror=mirror)
        if self.delta_lights is None:
            return radiance
        return radiance + self.delta_lights.mean_over_texel(n, frame, mi.Float(2 / resolution))

    def _finished(self, radiance: mi.Color3f) -> mi.Color3f:
        return radiance if self.keeps_negatives else dr.maximum(radiance, 0)

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> Any:
        """Return the arrays in which the prediction of a map is looked up, not yet evaluated."""
        raise NotImplementedError

    def _predicted(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: Any, resolution: int, *, mirror: bool = True
    ) -> mi.Color3f:
        """Prediction P [W sr⁻¹ m⁻²] for texels with normals `n` in the map's frame, without delta lights.

        With `mirror` false, without the delta lobe either.
        """
        raise NotImplementedError

    def _predicted_at(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Prediction P [W sr⁻¹ m⁻²] for pairs of normal and view, without delta lights."""
        raise NotImplementedError


@dataclass(frozen=True)
class ResidualOptions:
    """Options of a method with residuals.

    Attributes
    ----------
    inputs : MethodInputs
        Maps, environment and lobes of the bake.
    uses_maps : bool or None
        Whether residuals are added; None: added unless the bake holds a single map.
    lobe : str or None
        Reconstruct this lobe's part only: its prediction, and the residual of its own layer from the views that store
        one. The method is linear, so the parts of all lobes add up to the whole where nothing is clamped and every
        view stores all lobes. A part may be negative.
    """

    inputs: MethodInputs
    uses_maps: bool | None = None
    lobe: str | None = None

    @property
    def carries(self) -> bool:
        """Whether residuals are added."""
        return self.inputs.bake.has_views if self.uses_maps is None else self.uses_maps

    @property
    def mirror_density(self) -> float:
        """Sampling density of a delta lobe: `EXACT` where no residual corrects it, otherwise `ROUGH`."""
        return ROUGH if self.carries else EXACT

    @property
    def separate_mirror(self) -> str | None:
        """Name of the delta lobe if every map used here stores it as a layer of its own; None if it is carried along.

        It is carried if it is all that is asked for: then nothing else is stored, or single lobes are compared.
        """
        others = [lobe for lobe in self.inputs.lobes if not self.inputs.shapes[lobe.name][0].is_mirror]
        mirrors = [lobe for lobe in self.inputs.lobes if self.inputs.shapes[lobe.name][0].is_mirror]
        if not mirrors or not others or (self.lobe and self.lobe != mirrors[0].name):
            return None
        return mirrors[0].name if mirrors[0].views is None else None

    def carried_image(self, map_file: MapFile) -> NDArray[np.float32]:
        """Radiance of a stored map of which the residual is carried, (N, N, 3): without a separate delta lobe."""
        image = self.inputs.image(map_file, self.lobe)
        return image if self.separate_mirror is None else image - self.inputs.image(map_file, self.separate_mirror)

    def __str__(self) -> str:
        """Return the suffix of the method's name: `/lobe` for a single lobe."""
        return f"/{self.lobe}" if self.lobe else ""


_M = TypeVar("_M", bound=ResidualMethod)


def residual_method(
    kind: type[_M], name: str, options: ResidualOptions, weights: str, belief: Belief | None = None, **own: Any
) -> _M:
    """Make a method of class `kind`, and compute its residuals where it uses them.

    Parameters
    ----------
    kind : type
        Class of the method.
    name : str
        Name of the method.
    options : ResidualOptions
        Bake, and the options of the method.
    weights : str
        Barycentric weights of the residuals, one of `WEIGHTS`.
    belief : Belief, optional
        How far residuals are trusted; fully by default.
    **own
        Fields that `kind` adds to `ResidualMethod`.
    """
    inputs, lobe = options.inputs, options.lobe
    made = kind(
        f"{name}{options}",
        inputs.first_views(inputs.stored_count(lobe)),
        SourceMaps.none(),
        triangle_mix(WEIGHTS[weights]),
        MirrorWarp,
        albedo=LobeAlbedo.of(np.sum([np.array(record.albedo) for record in inputs.lobes], axis=0)),
        uses_maps=options.carries,
        carries_mirror=options.separate_mirror is None,
        keeps_negatives=lobe is not None or inputs.bake.rendering != "rgb",
        delta_lights=DeltaLightLobes.of(inputs.light, [one for one in inputs.lobes if lobe in (None, one.name)]),
        trust=None if belief is None else node_table(belief.residual),
        believes=belief is None or belief.is_full,
        hedge=_hedge(options, belief) if belief is not None and belief.is_hedged else None,
        **own,
    )
    if options.carries:
        stored = inputs.stored(lobe)
        made.sources = inputs.on_device([made.residual_of(options.carried_image(m), m.frame) for m in stored])
    return made


def _hedge(options: ResidualOptions, belief: Belief) -> Hedge:
    """Interpolation of the maps that `options` carries, with the weights of a belief."""
    inputs, lobe = options.inputs, options.lobe
    count = inputs.stored_count(lobe)
    sources = inputs.on_device([inputs.image(m, lobe) for m in inputs.stored(lobe)]) if lobe else inputs.sources
    warp, mix = WARPS[inputs.bake.manifest.material.warp], triangle_mix(WEIGHTS["area"])
    return Hedge(WarpBlend("", inputs.first_views(count), sources, mix, warp), node_table(belief.weight))

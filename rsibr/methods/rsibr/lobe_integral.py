"""Reflection integral of one lobe from the environment pyramid: the prediction P of `rsibr-fine`.

The lobe is a mixture of Gaussians over microfacet slopes (`rsibr.lobes.gaussians`). A narrow Gaussian is an anisotropic
footprint around the mirror direction, sampled along its long axis (`anisotropic_footprint.py`). A wide one is
integrated by quadrature over slopes; in a map it varies so slowly that the nodes of a coarse polar grid suffice.

P is an approximation. Its residual at the stored views is warped to the new view, so an error of P counts only as far
as it changes from view to view.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.refraction import emerging
from rsibr.geometry.to_device import to_device
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.basis import COAT_IOR, under_coat
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.microfacet import LEAST_COSINE, schlick, smith_denominator, transmitted
from rsibr.methods.rsibr.anisotropic_footprint import AnisotropicFootprint, ShadingFrame, tap_spreads
from rsibr.methods.rsibr.delta_lobe import ROUGH, DeltaLobe
from rsibr.methods.rsibr.polar_grid import PolarGrid

WIDE = 0.12
"""Standard deviation of slopes from which on a Gaussian is gathered at the nodes of the coarse grid."""

_POINTS = 192  # of the quadrature over wide Gaussians
_FILLING = 1.0  # width of a point's blur over the radius of the disk that it stands for
_Seen = Callable[[ShadingFrame, "mi.Vector3f"], tuple["mi.Vector3f", "mi.Float", "mi.Float", "mi.Float"]]
"""(surface, facet) → where it reflects the viewer to, its weight, its grazing term, and how it spreads."""

WideLight = Callable[[ShadingFrame], tuple["mi.Color3f", "mi.Color3f"]]
"""Surface → weighted light of the wide Gaussians [W sr⁻¹ m⁻²], and its weight."""

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(eq=False)
class QuadratureTable:
    """A list of three triples a row, on the device: where to look, and with what plain and grazing weight.

    Attributes
    ----------
    values : mi.Float
        Twelve floats a row, each triple padded to a packet, flat; one row of zeros at least.
    count : mi.UInt32
        How many rows there are (opaque: lists of other lengths need no other shape).
    is_empty : bool
        Whether there are none.
    """

    values: mi.Float
    count: mi.UInt32
    is_empty: bool

    @classmethod
    def of(cls, *columns: NDArray[np.float64]) -> QuadratureTable:
        """Put three columns of shape (M, 3) on the device."""
        rows = np.stack([np.pad(column, ((0, 0), (0, 1))) for column in columns], axis=1).reshape(-1, 12)
        values = rows if len(rows) else np.zeros((1, 12))
        return cls(to_device(mi.Float, values.astype(np.float32)), dr.opaque(mi.UInt32, len(rows)), not len(rows))

    def row(self, index: mi.UInt32) -> tuple[mi.Color3f, mi.Color3f, mi.Color3f]:
        """The three triples of a row."""
        packets = [dr.gather(mi.Vector4f, self.values, 3 * index + k) for k in range(3)]
        first, second, third = (mi.Color3f(p.x, p.y, p.z) for p in packets)
        return first, second, third


@dataclass(eq=False)
class LobeIntegral:
    """Radiance of a lobe over its directional albedo.

    Attributes
    ----------
    light : EnvironmentPyramid
        The light; of a matte lobe its irradiance, in one level.
    mirrored : DeltaLobe or None
        The light as a delta lobe shows it; None for any other.
    is_matte : bool
        Whether the lobe follows the normal.
    alpha : mi.Float
        Roughness that masking and shadowing go by.
    narrow : QuadratureTable
        Narrow Gaussians: (σ, 0, 0) and the weights.
    bare, coated : QuadratureTable
        Quadrature points of wide Gaussians, on the surface and under a coat: (slope x, slope y, area) and the weights.
    spreads : mi.Float
        See `rsibr.methods.rsibr.anisotropic_footprint.spreads_of_lookups`.
    """

    light: EnvironmentPyramid
    mirrored: DeltaLobe | None
    is_matte: bool
    alpha: mi.Float
    narrow: QuadratureTable
    bare: QuadratureTable
    coated: QuadratureTable
    spreads: mi.Float

    @classmethod
    def of(cls, shape: LobeShape, pyramid: EnvironmentPyramid, light: Light, density: float = ROUGH) -> LobeIntegral:
        """Put a lobe's shape on the device.

        Parameters
        ----------
        shape : LobeShape
            Its shape.
        pyramid : EnvironmentPyramid
            The light, blurred.
        light : Light
            The same light, as it is.
        density : float
            How finely a delta lobe looks; see `DeltaLobe`.
        """
        narrow = shape.bare.between(0, WIDE)
        widths = np.stack([narrow.sigmas, *[np.zeros_like(narrow.sigmas)] * 2], axis=1)
        return cls(
            light=EnvironmentPyramid.of_irradiance(light.irradiance(shape.matte)) if shape.is_matte else pyramid,
            mirrored=DeltaLobe.of(light, pyramid, density) if shape.is_mirror else None,
            is_matte=shape.is_matte,
            alpha=dr.opaque(mi.Float, shape.alpha),
            narrow=QuadratureTable.of(widths, narrow.plain, narrow.grazing),
            bare=_quadrature(shape.bare.between(WIDE, np.inf)),
            coated=_quadrature(shape.coated),
            spreads=tap_spreads(),
        )

    @property
    def has_grid(self) -> bool:
        """Whether some of the lobe is gathered at the nodes of the coarse grid."""
        return not (self.bare.is_empty and self.coated.is_empty)

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f, wide: WideLight | None = None) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`, over the lobe's albedo.

        Parameters
        ----------
        n, v : mi.Vector3f
            Unit vectors in world coordinates, one pair a lane.
        wide : callable, optional
            Gives light and weight of the wide Gaussians, such as `ViewNodes.lookup`; by default their quadrature.

        Returns
        -------
        mi.Color3f
            [W sr⁻¹ m⁻²]; under a constant light that light's radiance.
        """
        if self.is_matte:
            return self.light.fetch(n, mi.UInt32(0))
        if self.mirrored is not None:
            return self.mirrored.fetch(2 * dr.dot(n, v) * n - v)
        shading = ShadingFrame.of(n, v)
        narrow = self._gathered_narrow(shading, mi.Float(0))
        return _ratio(_sum(narrow, wide(shading) if wide else self.wide_light(shading)))

    def grid(self, frame: mi.Matrix3f) -> PolarGrid:
        """Gather the wide part of the lobe at the nodes of a grid over the map of `frame`, columns x, y, v."""
        n = frame @ PolarGrid.normals()
        v = mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2])
        light, weight = self.wide_light(ShadingFrame.of(n, v))
        return PolarGrid.of(light, weight)

    def radiance_in_map(
        self, n: mi.Vector3f, frame: mi.Matrix3f, grid: PolarGrid | None, spacing: mi.Float
    ) -> mi.Color3f:
        """Mean radiance over a texel of a sphere map, over the lobe's albedo.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals at the texels' centres in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        grid : PolarGrid or None
            The wide part, from `grid`; None for a lobe that has none.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk: a texel sees the facets of all its normals.
        """
        if self.is_matte:
            return self.light.fetch(frame @ n, mi.UInt32(0))
        if self.mirrored is not None:
            return self.mirrored.mean_over_texel(n, frame, spacing, lambda _cosine: mi.Color3f(1))
        shading = ShadingFrame.of(frame @ n, mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]))
        gathered = self._gathered_narrow(shading, spacing)
        return _ratio(gathered if grid is None else _sum(gathered, grid.lookup(n)))

    def _gathered_narrow(self, shading: ShadingFrame, spacing: mi.Float) -> tuple[mi.Color3f, mi.Color3f]:
        """Light and weight of the narrow Gaussians, gathered along the plane of incidence."""

        def gather(i: mi.UInt32, light: mi.Color3f, weight: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f, mi.Color3f]:
            sigma, plain, grazing = self.narrow.row(i)

            def colour(facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Color3f]:
                w, factor, grazed = self._reflected(shading.v, facet)
                return w, factor * (plain + grazing * grazed)

            a, b = AnisotropicFootprint.of(shading, sigma.x, spacing).gather(self.spreads, colour, self.light.blurred)
            return i + 1, light + a, weight + b

        _, light, weight = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1), dr.zeros(mi.Color3f, 1)),
            cond=lambda i, _light, _weight: i < self.narrow.count,
            body=gather,
            labels=("i", "light", "weight"),
            label="narrow_gaussians",
        )
        return light, weight

    def wide_light(self, shading: ShadingFrame) -> tuple[mi.Color3f, mi.Color3f]:
        """Light and weight of the wide Gaussians, by quadrature over slopes."""
        return _sum(
            self._quadrature(shading, self.bare, self._bare), self._quadrature(shading, self.coated, self._coated)
        )

    def _quadrature(self, shading: ShadingFrame, points: QuadratureTable, seen: _Seen) -> tuple[mi.Color3f, mi.Color3f]:
        def gather(i: mi.UInt32, light: mi.Color3f, weight: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f, mi.Color3f]:
            slope, plain, grazing = points.row(i)
            facet = dr.normalize(mi.Vector3f(slope.x, slope.y, 1))
            w, factor, grazed, stretch = seen(shading, facet)
            colour = factor * (plain + grazing * grazed)
            solid_angle = stretch * facet.z * facet.z * facet.z * slope.z
            width = dr.sqrt(solid_angle) * (_FILLING / np.sqrt(np.pi))
            return i + 1, light + colour * self.light.blurred(shading.to_world(w), width), weight + colour

        _, light, weight = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1), dr.zeros(mi.Color3f, 1)),
            cond=lambda i, _light, _weight: i < points.count,
            body=gather,
            labels=("i", "light", "weight"),
            label="wide_gaussians",
        )
        return light, weight

    def _bare(self, shading: ShadingFrame, facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float, mi.Float, mi.Float]:
        """Where a facet on the surface reflects the viewer to, its weight, its grazing term, and how it spreads."""
        w, factor, grazed = self._reflected(shading.v, facet)
        return w, factor, grazed, 4 * dr.maximum(dr.dot(facet, shading.v), 1e-3)

    def _coated(self, shading: ShadingFrame, facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float, mi.Float, mi.Float]:
        """The same for a facet under the coat; light that is reflected totally does not leave it."""
        inner_v = under_coat(shading.v)
        inner, factor, _ = self._reflected(inner_v, facet)
        x, y, height_squared = emerging(inner.x, inner.y, COAT_IOR)
        w = mi.Vector3f(x, y, dr.sqrt(dr.maximum(height_squared, 1e-6)))
        factor = dr.select(
            height_squared > 0, factor * transmitted(w.z) * transmitted(shading.cosine) * shading.cosine / inner_v.z, 0
        )
        bent = COAT_IOR * COAT_IOR * dr.maximum(inner.z, 0) / w.z
        return w, factor, mi.Float(0), 4 * dr.maximum(dr.dot(facet, inner_v), 1e-3) * bent

    def _reflected(self, v: mi.Vector3f, facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Where a facet reflects `v` to, what share of its light is seen, and Schlick's grazing term.

        f cos θ_i dω_i over the slopes: F G₂ (h·v)/(cos θ_o cos θ_h) times the density of slopes. The factor 1/cos θ_o
        is left out.
        """
        toward = dr.dot(facet, v)
        w = 2 * toward * facet - v
        cos_i, cos_o = dr.maximum(w.z, LEAST_COSINE), v.z
        shadowing = 2 * cos_i * cos_o / smith_denominator(cos_i, cos_o, self.alpha)
        factor = dr.select((toward > 0) & (w.z > 0), shadowing * toward / facet.z, 0)
        return w, factor, schlick(toward)


def _quadrature(gaussians: Gaussians) -> QuadratureTable:
    """Points on a sunflower spiral over the mixture, each with the area of slopes that it stands for."""
    sigmas, energy = gaussians.sigmas, (gaussians.plain + gaussians.grazing).sum(axis=1)
    if not len(sigmas):
        return QuadratureTable.of(*[np.zeros((0, 3))] * 3)
    radii = np.concatenate([[0.0], np.geomspace(1e-4, 8.0, 4000)])
    within = (energy * -np.expm1(-0.5 * (radii[:, None] / sigmas) ** 2)).sum(axis=1) / energy.sum()
    radius = np.interp((np.arange(_POINTS) + 0.5) / _POINTS * within[-1], within, radii)
    angle = np.arange(_POINTS) * _GOLDEN_ANGLE
    density = np.exp(-0.5 * (radius[:, None] / sigmas) ** 2) / (2 * np.pi * sigmas**2)
    area = 1 / (_POINTS * (density @ energy) / energy.sum())
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), area], axis=1)
    return QuadratureTable.of(
        places, density @ gaussians.plain * area[:, None], density @ gaussians.grazing * area[:, None]
    )


def _sum(a: tuple[mi.Color3f, mi.Color3f], b: tuple[mi.Color3f, mi.Color3f]) -> tuple[mi.Color3f, mi.Color3f]:
    return a[0] + b[0], a[1] + b[1]


def _ratio(gathered: tuple[mi.Color3f, mi.Color3f]) -> mi.Color3f:
    light, weight = gathered
    return light / dr.maximum(weight, 1e-20)

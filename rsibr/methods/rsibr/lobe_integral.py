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
"""Standard deviation of slopes from which a Gaussian counts as wide: integrated at the nodes of the polar grid."""

_POINTS = 192  # of the quadrature over wide Gaussians
_FILLING = 1.0  # standard deviation of a point's blur over the radius of a disk of its solid angle
_Seen = Callable[[ShadingFrame, "mi.Vector3f"], tuple["mi.Vector3f", "mi.Float", "mi.Float", "mi.Float"]]
"""(shading frame, microfacet normal) → reflected direction, weight, Schlick's term, and dω_i/dω_h."""

WideLight = Callable[[ShadingFrame], tuple["mi.Color3f", "mi.Color3f"]]
"""Shading frame → weighted radiance of the wide Gaussians [W sr⁻¹ m⁻²], and weight."""

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(eq=False)
class QuadratureTable:
    """Table on the device with three triples a row: a place in slope space, plain weight RGB, grazing weight RGB.

    Attributes
    ----------
    values : mi.Float
        Twelve floats a row, each triple padded to a packet of four, flat; at least one row (zeros if empty).
    count : mi.UInt32
        Number of rows. Opaque, so that tables of other lengths share a kernel.
    is_empty : bool
        Whether the table has no rows.
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
    """Reflection integral of a lobe divided by its directional albedo: P_k/E_k; docs/method.md, eq. 15.

    Attributes
    ----------
    light : EnvironmentPyramid
        Gaussian pyramid of the environment; for a matte lobe its irradiance map, in one level.
    mirrored : DeltaLobe or None
        Reflection of a delta lobe; None for any other.
    is_matte : bool
        Whether the lobe depends on the normal alone.
    alpha : mi.Float
        Roughness α of masking and shadowing.
    narrow : QuadratureTable
        Narrow Gaussians: (σ, 0, 0) and weights.
    bare, coated : QuadratureTable
        Quadrature points of wide Gaussians, on the surface and under a coat: (slope x, slope y, area) and weights.
    spreads : mi.Float
        From `rsibr.methods.rsibr.anisotropic_footprint.tap_spreads`.
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
            Mixture of Gaussians over slopes.
        pyramid : EnvironmentPyramid
            Gaussian pyramid of the environment.
        light : Light
            The environment itself.
        density : float
            Sampling density of a delta lobe: `EXACT` or `ROUGH`, see `DeltaLobe.of`.
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
        """Whether the lobe has wide Gaussians, which a map integrates at the nodes of a polar grid."""
        return not (self.bare.is_empty and self.coated.is_empty)

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f, wide: WideLight | None = None) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`, divided by the lobe's albedo.

        Parameters
        ----------
        n, v : mi.Vector3f
            Unit vectors in world coordinates, one pair a lane.
        wide : callable, optional
            Weighted radiance and weight of the wide Gaussians, such as `ViewNodes.lookup`; by default by quadrature.

        Returns
        -------
        mi.Color3f
            P_k/E_k [W sr⁻¹ m⁻²]. Under a constant environment it is the environment's radiance.
        """
        if self.is_matte:
            return self.light.fetch(n, mi.UInt32(0))
        if self.mirrored is not None:
            return self.mirrored.fetch(2 * dr.dot(n, v) * n - v)
        shading = ShadingFrame.of(n, v)
        narrow = self._gathered_narrow(shading, mi.Float(0))
        return _ratio(_sum(narrow, wide(shading) if wide else self.wide_light(shading)))

    def grid(self, frame: mi.Matrix3f) -> PolarGrid:
        """Integrate the wide Gaussians at the nodes of a polar grid over the map with `frame`, columns x, y, v."""
        n = frame @ PolarGrid.normals()
        v = mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2])
        light, weight = self.wide_light(ShadingFrame.of(n, v))
        return PolarGrid.of(light, weight)

    def radiance_in_map(
        self, n: mi.Vector3f, frame: mi.Matrix3f, grid: PolarGrid | None, spacing: mi.Float
    ) -> mi.Color3f:
        """Mean radiance over a texel of a sphere map, divided by the lobe's albedo.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals at the texels' centres in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        grid : PolarGrid or None
            Wide part, from `grid`; None for a lobe without wide Gaussians.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk; see `AnisotropicFootprint.of`.

        Returns
        -------
        mi.Color3f
            P_k/E_k [W sr⁻¹ m⁻²].
        """
        if self.is_matte:
            return self.light.fetch(frame @ n, mi.UInt32(0))
        if self.mirrored is not None:
            return self.mirrored.mean_over_texel(n, frame, spacing, lambda _cosine: mi.Color3f(1))
        shading = ShadingFrame.of(frame @ n, mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]))
        gathered = self._gathered_narrow(shading, spacing)
        return _ratio(gathered if grid is None else _sum(gathered, grid.lookup(n)))

    def _gathered_narrow(self, shading: ShadingFrame, spacing: mi.Float) -> tuple[mi.Color3f, mi.Color3f]:
        """Weighted radiance and weight of the narrow Gaussians over their footprints; docs/method.md, section 6.1."""

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
        """Weighted radiance [W sr⁻¹ m⁻²] and weight of the wide Gaussians by quadrature; docs/method.md, eq. 21."""
        return _sum(
            self._quadrature(shading, self.bare, self._bare), self._quadrature(shading, self.coated, self._coated)
        )

    def _quadrature(self, shading: ShadingFrame, points: QuadratureTable, seen: _Seen) -> tuple[mi.Color3f, mi.Color3f]:
        def gather(i: mi.UInt32, light: mi.Color3f, weight: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f, mi.Color3f]:
            slope, plain, grazing = points.row(i)
            facet = dr.normalize(mi.Vector3f(slope.x, slope.y, 1))
            w, factor, grazed, stretch = seen(shading, facet)
            colour = factor * (plain + grazing * grazed)
            solid_angle = stretch * facet.z * facet.z * facet.z * slope.z  # eq. 21: dω_h = cos³ θ_h dm
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
        """See `_Seen`, for a microfacet on the surface: dω_i/dω_h = 4 (h·v), docs/method.md, eq. 12."""
        w, factor, grazed = self._reflected(shading.v, facet)
        return w, factor, grazed, 4 * dr.maximum(dr.dot(facet, shading.v), 1e-3)

    def _coated(self, shading: ShadingFrame, facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float, mi.Float, mi.Float]:
        """See `_Seen`, for a microfacet under the coat; docs/method.md, eqs. 14 and 16."""
        # ---- Refract the viewer into the coat, reflect, refract out; zero under total internal reflection ----
        inner_v = under_coat(shading.v)
        inner, factor, _ = self._reflected(inner_v, facet)
        x, y, height_squared = emerging(inner.x, inner.y, COAT_IOR)
        w = mi.Vector3f(x, y, dr.sqrt(dr.maximum(height_squared, 1e-6)))
        # ---- Transmittance in and out; cos θ_o/cos θ_o' makes the weight commensurable with bare microfacets ----
        factor = dr.select(
            height_squared > 0, factor * transmitted(w.z) * transmitted(shading.cosine) * shading.cosine / inner_v.z, 0
        )
        # ---- Solid angle: eq. 21, refraction out of the coat included ----
        bent = COAT_IOR * COAT_IOR * dr.maximum(inner.z, 0) / w.z
        return w, factor, mi.Float(0), 4 * dr.maximum(dr.dot(facet, inner_v), 1e-3) * bent

    def _reflected(self, v: mi.Vector3f, facet: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Reflect `v` at a microfacet: direction, weight w(h) = G₂ (h·v)/cos θ_h, and Schlick's term (1 − h·v)⁵.

        docs/method.md, eqs. 13 and 16. The factor 1/cos θ_o of eq. 13 cancels in the ratio of eq. 15.
        """
        toward = dr.dot(facet, v)
        w = 2 * toward * facet - v
        cos_i, cos_o = dr.maximum(w.z, LEAST_COSINE), v.z
        shadowing = 2 * cos_i * cos_o / smith_denominator(cos_i, cos_o, self.alpha)
        factor = dr.select((toward > 0) & (w.z > 0), shadowing * toward / facet.z, 0)
        return w, factor, schlick(toward)


def _quadrature(gaussians: Gaussians) -> QuadratureTable:
    """Quadrature points on a sunflower spiral, distributed like the mixture, each with its area in slope space.

    docs/method.md, section 6.2.
    """
    sigmas, energy = gaussians.sigmas, (gaussians.plain + gaussians.grazing).sum(axis=1)
    if not len(sigmas):
        return QuadratureTable.of(*[np.zeros((0, 3))] * 3)
    # ---- Radii at the quantiles of the mixture's radial distribution, azimuths by the golden angle ----
    radii = np.concatenate([[0.0], np.geomspace(1e-4, 8.0, 4000)])
    within = (energy * -np.expm1(-0.5 * (radii[:, None] / sigmas) ** 2)).sum(axis=1) / energy.sum()
    radius = np.interp((np.arange(_POINTS) + 0.5) / _POINTS * within[-1], within, radii)
    angle = np.arange(_POINTS) * _GOLDEN_ANGLE
    # ---- Area of a point: 1/(M · density of the mixture) ----
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

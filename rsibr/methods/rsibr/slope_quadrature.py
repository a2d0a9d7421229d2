"""Quadrature over the slopes of wide Gaussians: mean light over their kernels for a surface and a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.refraction import emerging
from rsibr.geometry.to_device import to_device
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.lobes.basis import COAT_IOR, under_coat
from rsibr.lobes.microfacet import LEAST_COSINE, schlick, smith_denominator, transmitted
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.rsibr.lobe_terms import GaussianTerm

Array = NDArray[np.float64]

POINTS = 96
"""Points of the quadrature over the Gaussians of one lobe that lie alike under the coat or bare."""

_FILLING = 1.0  # standard deviation of a point's blur over the radius of a disk of its solid angle
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
_ROW = 12  # floats a point: slope x, slope y, area, α; plain RGB, 0; grazing RGB, 0


@dataclass(eq=False)
class SlopeQuadrature:
    """Points on the device, one set for the bare and one for the coated Gaussians.

    Attributes
    ----------
    bare, coated : mi.Float
        Twelve floats a point: slope x, slope y, area, α; plain weight RGB, 0; grazing weight RGB, 0. Flat; at least one
        point (zeros if there is none).
    bare_count, coated_count : mi.UInt32
        Number of points (opaque, so that all materials share kernels).
    """

    bare: mi.Float
    coated: mi.Float
    bare_count: mi.UInt32
    coated_count: mi.UInt32

    @classmethod
    def of(cls, terms: Sequence[GaussianTerm]) -> SlopeQuadrature:
        """Place the points for a few Gaussians of similar width."""
        bare, coated = (_points([term for term in terms if term.is_coated == under]) for under in (False, True))
        return cls(_on_device(bare), _on_device(coated), _count(bare), _count(coated))

    def light(self, shading: ShadingFrame, environment: EnvironmentPyramid) -> tuple[mi.Color3f, mi.Color3f]:
        """Weighted radiance [W sr⁻¹ m⁻²] and weight; docs/method.md, eq. 21."""
        on, under = (
            self._gathered(shading, environment, self.bare, self.bare_count, coated=False),
            self._gathered(shading, environment, self.coated, self.coated_count, coated=True),
        )
        return on[0] + under[0], on[1] + under[1]

    def _gathered(
        self,
        shading: ShadingFrame,
        environment: EnvironmentPyramid,
        points: mi.Float,
        count: mi.UInt32,
        *,
        coated: bool,
    ) -> tuple[mi.Color3f, mi.Color3f]:
        reflect = _from_under_coat if coated else _from_surface

        def gather(i: mi.UInt32, light: mi.Color3f, weight: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f, mi.Color3f]:
            place, plain, grazing = (dr.gather(mi.Vector4f, points, 3 * i + k) for k in range(3))
            facet = dr.normalize(mi.Vector3f(place.x, place.y, 1))
            w, factor, grazed, stretch = reflect(shading, facet, place.w)
            colour = factor * (_rgb(plain) + _rgb(grazing) * grazed)
            solid_angle = stretch * facet.z * facet.z * facet.z * place.z  # eq. 21: dω_h = cos³ θ_h dm
            width = dr.sqrt(solid_angle) * (_FILLING / np.sqrt(np.pi))
            return i + 1, light + colour * environment.blurred(shading.to_world(w), width), weight + colour

        _, light, weight = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1), dr.zeros(mi.Color3f, 1)),
            cond=lambda i, _light, _weight: i < count,
            body=gather,
            labels=("i", "light", "weight"),
            label="wide_gaussians",
        )
        return light, weight


def reflected(v: mi.Vector3f, facet: mi.Vector3f, alpha: mi.Float) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
    """Reflect `v` at a microfacet: direction, weight w(h) = G₂ (h·v)/(cos θ_o cos θ_h), and Schlick's (1 − h·v)⁵.

    docs/method.md, eqs. 13 and 16.
    """
    toward = dr.dot(facet, v)
    w = 2 * toward * facet - v
    cos_i, cos_o = dr.maximum(w.z, LEAST_COSINE), v.z
    shadowing = 2 * cos_i / smith_denominator(cos_i, cos_o, alpha)
    factor = dr.select((toward > 0) & (w.z > 0), shadowing * toward / facet.z, 0)
    return w, factor, schlick(toward)


def _from_surface(
    shading: ShadingFrame, facet: mi.Vector3f, alpha: mi.Float
) -> tuple[mi.Vector3f, mi.Float, mi.Float, mi.Float]:
    """Light direction, weight, Schlick's term, and dω_i/dω_h = 4 (h·v); docs/method.md, eq. 12."""
    w, factor, grazed = reflected(shading.v, facet, alpha)
    return w, factor, grazed, 4 * dr.maximum(dr.dot(facet, shading.v), 1e-3)


def _from_under_coat(
    shading: ShadingFrame, facet: mi.Vector3f, alpha: mi.Float
) -> tuple[mi.Vector3f, mi.Float, mi.Float, mi.Float]:
    """The same for a microfacet under the coat; docs/method.md, eqs. 14 and 16."""
    # ---- Refract the viewer into the coat, reflect, refract out; zero under total internal reflection ----
    inner_v = under_coat(shading.v)
    inner, factor, _ = reflected(inner_v, facet, alpha)
    x, y, height_squared = emerging(inner.x, inner.y, COAT_IOR)
    w = mi.Vector3f(x, y, dr.sqrt(dr.maximum(height_squared, 1e-6)))
    # ---- Transmittance in and out ----
    factor = dr.select(height_squared > 0, factor * transmitted(w.z) * transmitted(shading.cosine), 0)
    # ---- Solid angle: eq. 21, refraction out of the coat included ----
    bent = COAT_IOR * COAT_IOR * dr.maximum(inner.z, 0) / w.z
    return w, factor, mi.Float(0), 4 * dr.maximum(dr.dot(facet, inner_v), 1e-3) * bent


def _points(terms: Sequence[GaussianTerm]) -> Array:
    """Points of the Gaussians, a set for each masking (each lobe), shape (points, 12)."""
    alphas = sorted({term.alpha for term in terms})
    sets = [_spiral([term for term in terms if term.alpha == alpha]) for alpha in alphas]
    return np.concatenate(sets) if sets else np.zeros((0, _ROW))


def _spiral(terms: Sequence[GaussianTerm]) -> Array:
    """Points on a sunflower spiral, distributed like the mixture of `terms`, each with its area in slope space.

    docs/method.md, section 6.2.
    """
    sigmas = np.array([term.sigma for term in terms])
    plain, grazing = (np.stack([getattr(term, name) for term in terms]) for name in ("plain", "grazing"))
    energy = np.maximum((plain + grazing).sum(axis=1), 1e-30)
    # ---- Radii at the quantiles of the mixture's radial distribution, azimuths by the golden angle ----
    radii = np.concatenate([[0.0], np.geomspace(1e-4, 8.0, 4000)])
    within = (energy * -np.expm1(-0.5 * (radii[:, None] / sigmas) ** 2)).sum(axis=1) / energy.sum()
    radius = np.interp((np.arange(POINTS) + 0.5) / POINTS * within[-1], within, radii)
    angle = np.arange(POINTS) * _GOLDEN_ANGLE
    # ---- Area of a point: 1/(M · density of the mixture) ----
    density = np.exp(-0.5 * (radius[:, None] / sigmas) ** 2) / (2 * np.pi * sigmas**2)
    area = energy.sum() / (POINTS * (density @ energy))
    rows = np.zeros((POINTS, _ROW))
    rows[:, :4] = np.stack([radius * np.cos(angle), radius * np.sin(angle), area, np.full(POINTS, terms[0].alpha)], 1)
    rows[:, 4:7], rows[:, 8:11] = density @ plain * area[:, None], density @ grazing * area[:, None]
    return rows


def _on_device(rows: Array) -> mi.Float:
    return to_device(mi.Float, (rows if len(rows) else np.zeros((1, _ROW))).astype(np.float32))


def _count(rows: Array) -> mi.UInt32:
    return dr.opaque(mi.UInt32, len(rows))


def _rgb(values: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(values.x, values.y, values.z)

"""Car paint as a Mitsuba BSDF: clear coat over pigment and metallic flakes, with all orders of interreflection.

    f = f_coat + T(ω_i) T(ω_o) / η² · [ ρ* a(ω_i) a(ω_o) / π + f_flakes + f_retro + f_between ](ω_i', ω_o')

with ω' the refracted directions and T(ω) = (1 − E_coat(ω)) exp(−τ / cos θ'). `rsibr.scene.paint.layers` tabulates the
interreflection: ρ* between pigment and coat, a from flakes and coat to the pigment, f_between among the flakes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.scene.paint.layers import AZIMUTH_NODES, COSINE_NODES, SINE_NODES
from rsibr.scene.paint.lobes import emerging, ggx, half_turn, microfacet_mirrors, mirrored, refracted
from rsibr.scene.paint.recipe import PaintRecipe
from rsibr.scene.paint.spectra import PaintColours, PaintSpectra, along, lookup_table
from rsibr.scene.variant_class import variant_class

PLUGIN = "rsibr_car_paint"
"""Name of the BSDF in Mitsuba XML and dictionaries."""

PIGMENT, COAT, FLAKES, RETRO = range(4)
"""Indices for `BSDFContext.component`; the last exists only if the paint is retroreflective."""

_HORIZON = 1e-7  # cosine up to which a direction counts as on the horizon: Fresnel and tables stay finite


@dataclass(frozen=True)
class _Side:
    """A direction outside, its refraction into the coat, and the transmittance of the coat."""

    cosine: mi.Float
    inner: mi.Vector3f
    transmitted: mi.UnpolarizedSpectrum
    entry: mi.UnpolarizedSpectrum


class CarPaint:
    """Coated paint with the parameters of `PaintRecipe`, which can be changed through `mi.traverse`.

    `register` derives a class of the current variant with these methods. Not
    differentiable in its parameters. In spectral variants colours are spectra, as Mitsuba converts them, and cannot be
    changed through `mi.traverse`. In polarised variants the reflected light is assumed to be unpolarised.

    Components: pigment (diffuse), coat (glossy; delta if `coat_alpha` is 0), flakes (glossy), and retroreflection
    (glossy) if the paint has any. Light reflected several times below the coat belongs to the pigment if it met the
    pigment, otherwise to the flakes. The components add up to the BSDF.
    """

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        recipe = PaintRecipe.from_properties(props)
        self._recipe = recipe
        self._parameters = {
            f.name: (mi.UnpolarizedSpectrum if f.type == "Colour" else mi.Float)(getattr(recipe, f.name))
            for f in fields(recipe)
            if f.type != "Colour" or not mi.is_spectral
        }
        self._prepare(recipe)

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Expose the parameters to Mitsuba."""
        for name, value in self._parameters.items():
            callback.put(name, value, mi.ParamFlags.NonDifferentiable)

    def parameters_changed(self, keys: list[str]) -> None:  # noqa: ARG002  # every parameter affects every table
        """Solve the layers for the changed parameters."""
        host = {name: np.array(value, dtype=np.float64).ravel() for name, value in self._parameters.items()}
        given: dict[str, Any] = {
            f.name: host[f.name] for f in fields(PaintRecipe) if f.name in host and f.type == "Colour"
        }
        given |= {name: float(value[0]) for name, value in host.items() if name not in given}
        self._recipe = replace(self._recipe, **given)
        self._prepare(self._recipe)

    def eval_pdf(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
    ) -> tuple[mi.Spectrum, mi.Float]:
        """Value of f·cos θ_o and density of the selected components, without delta components."""
        value, pdf = self._unpolarised(ctx, si, wo, active)
        return mi.mueller.depolarizer(value) if mi.is_polarized else value, pdf

    def _unpolarised(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool
    ) -> tuple[mi.UnpolarizedSpectrum, mi.Float]:
        """Value of f·cos θ_o for unpolarised light, and density."""
        # Directions inside the coat, transmittance, and the factor of the solid angle on refraction
        active = active & (si.wi.z > 0) & (wo.z > 0)
        colours = self._spectra.at(si)
        i, o = self._side(si.wi, colours), self._side(wo, colours)
        shares = self._shares(ctx, i.cosine)
        through = i.transmitted * o.transmitted * (o.cosine / self._eta**2)
        squeeze = o.cosine / (self._eta**2 * o.inner.z)  # dω' / dω
        # Components below the coat, then the coat itself
        value, pdf = mi.UnpolarizedSpectrum(0), mi.Float(0)
        if PIGMENT in shares:
            value += through * colours.diffuse * i.entry * o.entry * dr.inv_pi
            pdf += shares[PIGMENT] * o.cosine * dr.inv_pi
        if FLAKES in shares:
            lobe, density = microfacet_mirrors(self._flake_ggx, i.inner, o.inner)
            value += through * (colours.flakes * lobe + self._between(i.inner, o.inner, colours))
            pdf += shares[FLAKES] * density * squeeze
        if RETRO in shares:
            lobe, density = microfacet_mirrors(self._retro_ggx, i.inner, half_turn(o.inner))
            value += through * colours.retro * lobe
            pdf += shares[RETRO] * density * squeeze
        if COAT in shares and not self._is_smooth:
            lobe, density = microfacet_mirrors(self._coat_ggx, si.wi, wo)
            facet = dr.normalize(si.wi + wo)
            value += lobe * o.cosine * mi.fresnel(dr.dot(si.wi, facet), self._eta)[0]
            pdf += shares[COAT] * density
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def sample(
        self,
        ctx: mi.BSDFContext,
        si: mi.SurfaceInteraction3f,
        sample1: mi.Float,
        sample2: mi.Point2f,
        active: mi.Bool = True,
    ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
        """Sample a direction from one component, weighted by the density of all components."""
        # Sample a direction from one component, chosen by its share
        shares = self._shares(ctx, si.wi.z)
        drawn = dr.zeros(mi.BSDFSample3f, dr.width(si.wi))
        drawn.eta = 1.0
        below = mi.Float(0)
        for component, share in shares.items():
            chosen = sample1 >= below  # the last component for which this holds is chosen
            below = below + share
            drawn.wo = dr.select(chosen, self._draw(component, si.wi, sample2), drawn.wo)
            drawn.sampled_component = dr.select(chosen, mi.UInt32(component), drawn.sampled_component)
            kind = int(self.m_components[component]) & int(mi.BSDFFlags.All)
            drawn.sampled_type = dr.select(chosen, mi.UInt32(kind), drawn.sampled_type)
        # Weight by the density of all smooth components; a smooth coat is a delta lobe with a density of its own
        active = active & (si.wi.z > 0) & (drawn.wo.z > 0)
        value, drawn.pdf = self._unpolarised(ctx, si, drawn.wo, active)
        weight = value / dr.select(drawn.pdf > 0, drawn.pdf, 1)
        if COAT in shares and self._is_smooth:
            mirrored = drawn.sampled_component == COAT
            drawn.pdf = dr.select(mirrored, shares[COAT], drawn.pdf)
            weight = dr.select(mirrored, mi.fresnel(si.wi.z, self._eta)[0] / shares[COAT], weight)
        active = active & (drawn.pdf > 0)
        weight = dr.select(active, weight, 0)
        return drawn, mi.mueller.depolarizer(weight) if mi.is_polarized else weight

    def to_string(self) -> str:
        """Name and parameters."""
        return f"CarPaint[{', '.join(f'{k} = {v}' for k, v in self._parameters.items())}]"

    def _prepare(self, recipe: PaintRecipe) -> None:
        """Solve the layers, and copy their tables and parameters to the device as opaque data."""
        # Components and their flags
        tables = recipe.solve()
        flags = mi.BSDFFlags
        coat = flags.GlossyReflection if recipe.coat_alpha > 0 else flags.DeltaReflection
        kinds = [flags.DiffuseReflection, coat, flags.GlossyReflection]
        if recipe.retro_share > 0:
            kinds.append(flags.GlossyReflection)
        self.m_components = [kind | flags.FrontSide for kind in kinds]
        self.m_flags = int(np.bitwise_or.reduce([int(kind) for kind in self.m_components]))
        # Parameters and tables on the device
        self._is_smooth = recipe.coat_alpha == 0
        self._eta = dr.opaque(mi.Float, recipe.int_ior)
        self._flake_ggx, self._retro_ggx = ggx(recipe.flakes.alpha), ggx(recipe.retro.alpha)
        self._coat_ggx = ggx(max(recipe.coat_alpha, 1e-4))
        self._spectra = PaintSpectra(
            tables.diffuse,
            recipe.flakes.reflectance,
            recipe.retro.reflectance,
            recipe.depth,
            tables.entry,
            tables.interreflection,
        )
        self._by_cosine = lookup_table(np.column_stack([tables.coat, self._spectra.entry]), 1)
        self._share_table = lookup_table(tables.albedo, 1)
        self._between_table = lookup_table(self._spectra.between, 3)

    def _side(self, w: mi.Vector3f, colours: PaintColours) -> _Side:
        cosine = dr.maximum(w.z, _HORIZON)
        ratio, *entry = self._by_cosine.eval(along(dr.sqrt(cosine), COSINE_NODES))
        inner = refracted(w, self._eta)
        through = 1 - mi.fresnel(cosine, self._eta)[0] * ratio
        return _Side(cosine, inner, through * dr.exp(-colours.depth / inner.z), colours.entry(entry))

    def _between(self, i: mi.Vector3f, o: mi.Vector3f, colours: PaintColours) -> mi.UnpolarizedSpectrum:
        """BRDF [sr⁻¹] of two or more reflections among flakes, from the table."""
        azimuth = dr.abs(dr.atan2(i.x * o.y - i.y * o.x, i.x * o.x + i.y * o.y))
        sines = [along(dr.minimum(dr.hypot(w.x, w.y) * self._eta, 1), SINE_NODES) for w in (i, o)]
        return colours.between(self._between_table.eval(mi.Point3f(*sines, along(azimuth * dr.inv_pi, AZIMUTH_NODES))))

    def _shares(self, ctx: mi.BSDFContext, cosine: mi.Float) -> dict[int, mi.Float]:
        """Probability of each component that the context enables: its share of the albedo."""
        albedo = self._share_table.eval(along(dr.safe_sqrt(cosine), COSINE_NODES))
        asked = [k for k, kind in enumerate(self.m_components) if ctx.is_enabled(_kind(kind), k)]
        floor = 1e-6  # avoids 0/0 if only a component without albedo is enabled
        total = sum((albedo[k] + floor for k in asked), mi.Float(0))
        return {k: (albedo[k] + floor) / total for k in asked}

    def _draw(self, component: int, wi: mi.Vector3f, u: mi.Point2f) -> mi.Vector3f:
        if component == PIGMENT:
            return mi.warp.square_to_cosine_hemisphere(u)
        if component == COAT:
            return mi.reflect(wi) if self._is_smooth else mirrored(self._coat_ggx, wi, u)
        inner = refracted(wi, self._eta)
        if component == FLAKES:
            return emerging(mirrored(self._flake_ggx, inner, u), self._eta)
        return emerging(half_turn(mirrored(self._retro_ggx, inner, u)), self._eta)


@backend.on_variant
def register() -> None:
    """Register the plugin in the current variant."""
    mi.register_bsdf(PLUGIN, _create)


def _create(props: mi.Properties) -> Any:
    return variant_class(CarPaint)(props)


def _kind(flags: int) -> mi.BSDFFlags:
    return next(
        kind
        for kind in (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DeltaReflection)
        if int(flags) & int(kind)
    )

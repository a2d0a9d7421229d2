"""Car paint, a BSDF for Mitsuba: clear coat over pigment and metallic flakes, with all light that goes back and forth.

    f = f_coat + T(ω_i) T(ω_o) / η² · [ ρ* a(ω_i) a(ω_o) / π + f_flakes + f_retro + f_between ](ω_i', ω_o')

with ω' the refracted directions and T(ω) = (1 − E_coat(ω)) exp(−τ / cos θ'). `rsibr.scene.paint_layers` gives the rest:
the pigment's own series ρ*, the light that flakes and coat throw at the pigment a, and several reflections among flakes
f_between.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.geometry.resident import resident
from rsibr.scene.paint_layers import AZIMUTH_NODES, COSINE_NODES, SINE_NODES, CoatTables
from rsibr.scene.paint_lobes import emerging, ggx, half_turn, microfacet_mirrors, mirrored, refracted
from rsibr.scene.paint_recipe import PaintRecipe

PLUGIN = "rsibr_car_paint"
"""Name of the BSDF in Mitsuba XML and dictionaries."""

PIGMENT, COAT, FLAKES, RETRO = range(4)
"""Index of each component, as `BSDFContext.component` takes it; the last is there only where the paint has it."""

_LEAST_COSINE = 1e-7


@dataclass(frozen=True)
class _Side:
    """One direction outside and the refracted one below the coat, with what the coat lets through."""

    cosine: mi.Float
    inner: mi.Vector3f
    transmitted: mi.Spectrum
    entry: mi.Spectrum


class CarPaint:
    """Coated paint. Its parameters are those of `PaintRecipe`; all can be changed through `mi.traverse`.

    Mitsuba has a BSDF class for each variant: `register` derives from it with these methods. Not differentiable in its
    parameters.

    Components: pigment (diffuse), coat (glossy; delta where `coat_alpha` is 0), flakes (glossy), and back-reflection
    (glossy) where the paint has any. Light reflected several times below the coat counts as pigment if the pigment took
    part, otherwise as flakes. The components add up to the whole.
    """

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        recipe = PaintRecipe.from_properties(props)
        self._parameters = {
            f.name: (mi.Spectrum if f.type == "Colour" else mi.Float)(getattr(recipe, f.name)) for f in fields(recipe)
        }
        self._prepare(recipe)

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Hand Mitsuba the parameters."""
        for name, value in self._parameters.items():
            callback.put(name, value, mi.ParamFlags.NonDifferentiable)

    def parameters_changed(self, keys: list[str]) -> None:  # noqa: ARG002  # any of them enters every table
        """Solve the layers anew."""
        host = {name: np.array(value, dtype=np.float64).ravel() for name, value in self._parameters.items()}
        given: dict[str, Any] = {f.name: host[f.name] for f in fields(PaintRecipe) if f.type == "Colour"}
        given |= {name: float(value[0]) for name, value in host.items() if name not in given}
        self._prepare(PaintRecipe(**given))

    def eval(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
    ) -> mi.Spectrum:
        """Value of f·cos θ_o."""
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
    ) -> mi.Float:
        """Density [1/sr] with which `sample` draws `wo`."""
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
    ) -> tuple[mi.Spectrum, mi.Float]:
        """Value of f·cos θ_o and density, of the components that are asked for, delta ones excepted."""
        active = active & (si.wi.z > 0) & (wo.z > 0)
        i, o = self._side(si.wi), self._side(wo)
        shares = self._shares(ctx, i.cosine)
        through = i.transmitted * o.transmitted * (o.cosine / self._eta**2)
        squeeze = o.cosine / (self._eta**2 * o.inner.z)  # dω' / dω
        value, pdf = mi.Spectrum(0), mi.Float(0)
        if PIGMENT in shares:
            value += through * self._diffuse * i.entry * o.entry * dr.inv_pi
            pdf += shares[PIGMENT] * o.cosine * dr.inv_pi
        if FLAKES in shares:
            lobe, density = microfacet_mirrors(self._flake_ggx, i.inner, o.inner)
            value += through * (self._flakes * lobe + self._between(i.inner, o.inner))
            pdf += shares[FLAKES] * density * squeeze
        if RETRO in shares:
            lobe, density = microfacet_mirrors(self._retro_ggx, i.inner, half_turn(o.inner))
            value += through * self._retro * lobe
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
        """Draw a direction from one component, and weigh it by all that could have drawn it."""
        shares = self._shares(ctx, si.wi.z)
        drawn = dr.zeros(mi.BSDFSample3f, dr.width(si.wi))
        drawn.eta = 1.0
        below = mi.Float(0)
        for component, share in shares.items():
            chosen = sample1 >= below  # the last that holds is the one
            below = below + share
            drawn.wo = dr.select(chosen, self._draw(component, si.wi, sample2), drawn.wo)
            drawn.sampled_component = dr.select(chosen, mi.UInt32(component), drawn.sampled_component)
            kind = int(self.m_components[component]) & int(mi.BSDFFlags.All)
            drawn.sampled_type = dr.select(chosen, mi.UInt32(kind), drawn.sampled_type)
        active = active & (si.wi.z > 0) & (drawn.wo.z > 0)
        value, drawn.pdf = self.eval_pdf(ctx, si, drawn.wo, active)
        weight = value / dr.select(drawn.pdf > 0, drawn.pdf, 1)
        if COAT in shares and self._is_smooth:
            mirrored = drawn.sampled_component == COAT
            drawn.pdf = dr.select(mirrored, shares[COAT], drawn.pdf)
            weight = dr.select(mirrored, mi.fresnel(si.wi.z, self._eta)[0] / shares[COAT], weight)
        active = active & (drawn.pdf > 0)
        return drawn, dr.select(active, weight, 0)

    def to_string(self) -> str:
        """Name and parameters."""
        return f"CarPaint[{', '.join(f'{k} = {v}' for k, v in self._parameters.items())}]"

    def _prepare(self, recipe: PaintRecipe) -> None:
        """Solve the layers, and put on the device what the kernels need: as data, never as constants."""
        tables = recipe.solve()
        flags = mi.BSDFFlags
        coat = flags.GlossyReflection if recipe.coat_alpha > 0 else flags.DeltaReflection
        kinds = [flags.DiffuseReflection, coat, flags.GlossyReflection]
        if recipe.retro_share > 0:
            kinds.append(flags.GlossyReflection)
        self.m_components = [kind | flags.FrontSide for kind in kinds]
        self.m_flags = int(np.bitwise_or.reduce([int(kind) for kind in self.m_components]))
        self._is_smooth = recipe.coat_alpha == 0
        self._eta, self._depth = _scalar(recipe.int_ior), _colour(recipe.depth)
        self._diffuse, self._flakes = _colour(tables.diffuse), _colour(recipe.flakes.reflectance)
        self._retro = _colour(recipe.retro.reflectance)
        self._flake_ggx, self._retro_ggx = ggx(recipe.flakes.alpha), ggx(recipe.retro.alpha)
        self._coat_ggx = ggx(max(recipe.coat_alpha, 1e-4))
        self._upload(tables)

    def _upload(self, tables: CoatTables) -> None:
        self._by_cosine = _texture(np.column_stack([tables.coat, tables.entry]), 1)
        self._share_table = _texture(tables.albedo, 1)
        self._between_table = _texture(tables.interreflection, 3)

    def _side(self, w: mi.Vector3f) -> _Side:
        cosine = dr.maximum(w.z, _LEAST_COSINE)
        ratio, *entry = self._by_cosine.eval(_along(dr.sqrt(cosine), COSINE_NODES))[: 1 + dr.size_v(mi.Spectrum)]
        inner = refracted(w, self._eta)
        through = 1 - mi.fresnel(cosine, self._eta)[0] * ratio
        return _Side(cosine, inner, through * dr.exp(-self._depth / inner.z), mi.Spectrum(entry))

    def _between(self, i: mi.Vector3f, o: mi.Vector3f) -> mi.Spectrum:
        """BRDF of two and more reflections among flakes, from the table."""
        azimuth = dr.abs(dr.atan2(i.x * o.y - i.y * o.x, i.x * o.x + i.y * o.y))
        sines = [_along(dr.minimum(dr.hypot(w.x, w.y) * self._eta, 1), SINE_NODES) for w in (i, o)]
        found = self._between_table.eval(mi.Point3f(*sines, _along(azimuth * dr.inv_pi, AZIMUTH_NODES)))
        return mi.Spectrum(found[: dr.size_v(mi.Spectrum)])

    def _shares(self, ctx: mi.BSDFContext, cosine: mi.Float) -> dict[int, mi.Float]:
        """Probability of each component that the context asks for: its share of the albedo."""
        albedo = self._share_table.eval(_along(dr.safe_sqrt(cosine), COSINE_NODES))
        asked = [k for k, kind in enumerate(self.m_components) if ctx.is_enabled(_kind(kind), k)]
        floor = 1e-6  # a paint without pigment asked for its pigment: nothing, but not by dividing by zero
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
    variant = mi.variant()
    if "spectral" in variant or "polarized" in variant:
        raise InputError(f"works in the RGB and mono variants of Mitsuba, not in {variant}")
    return _class_for(variant)(props)


@cache
def _class_for(variant: str) -> type:
    """The methods of `CarPaint` on the variant's own base class; the binding allows no second base."""
    methods = {name: member for name, member in vars(CarPaint).items() if name not in ("__dict__", "__weakref__")}
    return type(f"CarPaint_{variant}", (mi.BSDF,), methods)


def _kind(flags: int) -> mi.BSDFFlags:
    return next(
        kind
        for kind in (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DeltaReflection)
        if int(flags) & int(kind)
    )


def _along(position: mi.Float, nodes: int) -> mi.Float:
    """Texture coordinate of a position 0 … 1 between the first and the last of `nodes` texels."""
    return (position * (nodes - 1) + 0.5) / nodes


def _texture(values: NDArray[np.float64], dimensions: int) -> Any:
    """A table with linear interpolation in float32; channels padded to four, which one load can fetch."""
    padded = np.zeros((*values.shape[:dimensions], 4), dtype=np.float32)
    padded[..., : values.shape[-1]] = values
    kind = {1: mi.Texture1f, 3: mi.Texture3f}[dimensions]
    if not dr.is_jit_v(mi.Float):
        return kind(mi.TensorXf(padded))
    return kind(mi.TensorXf(resident(mi.Float, padded), shape=padded.shape), use_accel=False)


def _scalar(value: float) -> mi.Float:
    return dr.opaque(mi.Float, value)


def _colour(values: Iterable[float]) -> mi.Spectrum:
    colour = mi.Spectrum([float(v) for v in values])
    dr.make_opaque(colour)
    return colour

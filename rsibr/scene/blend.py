"""Blend of two BSDFs, in place of Mitsuba's `blendbsdf`, whose `sample` and `pdf` disagree on delta components.

    f = (1 − w) f₀ + w f₁

A BSDF is chosen with probability w or 1 − w. A delta direction keeps its own weight, because no other component
reflects there; any other direction is weighted by the density of both (the balance heuristic, Veach 1997, section 9.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from rsibr import backend
from rsibr.scene.sampling_density import sound_density
from rsibr.scene.variant_class import variant_class

PLUGIN = "rsibr_blendbsdf"
"""Name of the BSDF, which `rsibr.scene.mitsuba_bsdf` puts in place of `blendbsdf`."""

_ALL = int(mi.BSDFFlags.All)


@dataclass(frozen=True)
class _Part:
    """A nested BSDF, its context, its share of the light, and the probability with which `sample` chooses it."""

    bsdf: mi.BSDF
    context: mi.BSDFContext
    share: mi.Float
    chance: mi.Float
    first_component: int


class Blend:
    """Blend of two nested BSDFs by a weight; parameters and components are those of Mitsuba's `blendbsdf`.

    `register` derives a class of the current variant. Components: those of the first BSDF, then of the second.
    """

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        self._weight = props.get_texture("weight")
        nested = [value for _, value in props.objects() if isinstance(value, mi.BSDF)]
        if len(nested) != 2:
            raise RuntimeError("takes two nested BSDFs")
        self._nested = nested
        self.m_components = [bsdf.flags(i) for bsdf in nested for i in range(bsdf.component_count())]
        self.m_flags = nested[0].flags() | nested[1].flags()

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Expose the weight and the nested BSDFs to Mitsuba."""
        callback.put("weight", self._weight, mi.ParamFlags.Differentiable)
        for index, bsdf in enumerate(self._nested):
            callback.put(f"bsdf_{index}", bsdf, mi.ParamFlags.Differentiable)

    def eval_pdf(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
    ) -> tuple[mi.Spectrum, mi.Float]:
        """Value of f·cos θ_o and density of the selected components, without delta components."""
        value, density = mi.Spectrum(0), mi.Float(0)
        for part in self._parts(ctx, si):
            own, pdf = part.bsdf.eval_pdf(part.context, si, wo, active)
            value += part.share * own
            density += part.chance * sound_density(own, pdf)
        return value, density

    def sample(
        self,
        ctx: mi.BSDFContext,
        si: mi.SurfaceInteraction3f,
        sample1: mi.Float,
        sample2: mi.Point2f,
        active: mi.Bool = True,
    ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
        """Sample a direction from one of the BSDFs, weighted by the density of both unless it is a delta direction."""
        # ---- One of the BSDFs, and the rest of the random number that chose it ----
        parts = self._parts(ctx, si)
        first, second = (part.chance for part in parts)
        is_second = sample1 < second
        rest = dr.select(is_second, sample1 / dr.maximum(second, _TINY), (sample1 - second) / dr.maximum(first, _TINY))
        rest = dr.clip(rest, 0, _BELOW_ONE)
        drawn, weight = dr.zeros(mi.BSDFSample3f, dr.width(si.wi)), mi.Spectrum(0)
        for part, is_chosen in zip(parts, (~is_second, is_second), strict=True):
            chosen = active & is_chosen & (part.chance > 0)
            own, value = part.bsdf.sample(part.context, si, rest, sample2, chosen)
            own.sampled_component += part.first_component
            own.pdf *= part.chance
            weight = dr.select(chosen, value * (part.share / dr.maximum(part.chance, _TINY)), weight)
            drawn = dr.select(chosen, own, drawn)
        # ---- Density of both ----
        value, density = self.eval_pdf(ctx, si, drawn.wo, active)
        is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
        both = ~is_delta & (drawn.pdf > 0)
        drawn.pdf = dr.select(both, density, drawn.pdf)
        weight = dr.select(both, value * dr.select(density > 0, dr.rcp(density), 0), weight)
        return drawn, dr.select(active & (drawn.pdf > 0), weight, 0)

    def to_string(self) -> str:
        """Name, weight and nested BSDFs."""
        return f"Blend[weight = {self._weight}, {self._nested[0]}, {self._nested[1]}]"

    def _parts(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f) -> list[_Part]:
        """The nested BSDFs; one that holds no selected component has no share of the light and is never chosen."""
        weight = dr.clip(self._weight.eval_1(si), 0, 1)
        contexts = self._contexts(ctx)
        selected = [_selects(context, bsdf) for bsdf, context in zip(self._nested, contexts, strict=True)]
        parts, first_component = [], 0
        for index, share in enumerate((1 - weight, weight)):
            chance = share if all(selected) else mi.Float(float(selected[index]))
            own = share if selected[index] else mi.Float(0)
            parts.append(_Part(self._nested[index], contexts[index], own, chance, first_component))
            first_component += self._nested[index].component_count()
        return parts

    def _contexts(self, ctx: mi.BSDFContext) -> list[mi.BSDFContext]:
        """Context of each nested BSDF, its components numbered from 0; component `_NONE` selects none."""
        count = self._nested[0].component_count()
        if ctx.component == _EVERY:
            return [ctx, ctx]
        contexts = [_copy(ctx), _copy(ctx)]
        of_first = ctx.component < count
        contexts[0].component = ctx.component if of_first else _NONE
        contexts[1].component = _NONE if of_first else ctx.component - count
        return contexts


_TINY = 1e-7
_BELOW_ONE = 1 - 2**-24
_EVERY, _NONE = 2**32 - 1, 2**31 - 1


def _copy(ctx: mi.BSDFContext) -> mi.BSDFContext:
    context = mi.BSDFContext()
    context.mode, context.type_mask, context.component = ctx.mode, ctx.type_mask, ctx.component
    return context


def _selects(ctx: mi.BSDFContext, bsdf: mi.BSDF) -> bool:
    """Whether a context selects any component of a BSDF."""
    count = bsdf.component_count()
    wanted = range(count) if ctx.component == _EVERY else [i for i in (ctx.component,) if i < count]
    return any(int(bsdf.flags(i)) & _ALL & int(ctx.type_mask) for i in wanted)


@backend.on_variant
def register() -> None:
    """Register the plugin in the current variant."""
    mi.register_bsdf(PLUGIN, _create)


def _create(props: mi.Properties) -> Any:
    return variant_class(Blend)(props)

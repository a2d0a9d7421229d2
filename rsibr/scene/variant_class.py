"""BSDF classes written once for all variants of Mitsuba."""

from __future__ import annotations

from functools import cache

import mitsuba as mi


def variant_class(methods_of: type) -> type:
    """Class with the methods of `methods_of` and the current variant's `mi.BSDF` as its base.

    Mitsuba has a BSDF class for each variant, and its binding allows no second base. `eval` and `pdf`, which Mitsuba
    asks for as well, are the two parts of what `eval_pdf` returns.
    """
    return _derived(methods_of, mi.variant())


@cache
def _derived(methods_of: type, variant: str) -> type:
    own = {name: member for name, member in vars(methods_of).items() if name not in ("__dict__", "__weakref__")}
    return type(f"{methods_of.__name__}_{variant}", (mi.BSDF,), {"eval": _eval, "pdf": _pdf, **own})


def _eval(
    self: mi.BSDF, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
) -> mi.Spectrum:
    """Value of f·cos θ_o."""
    return self.eval_pdf(ctx, si, wo, active)[0]


def _pdf(
    self: mi.BSDF, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool = True
) -> mi.Float:
    """Density [1/sr] with which `sample` draws `wo`."""
    return self.eval_pdf(ctx, si, wo, active)[1]

"""BSDF classes written once for all variants of Mitsuba."""

from __future__ import annotations

from functools import cache

import mitsuba as mi


def variant_class(methods_of: type) -> type:
    """Class with the methods of `methods_of` and the current variant's `mi.BSDF` as its base.

    Mitsuba has a BSDF class for each variant, and its binding allows no second base.
    """
    return _derived(methods_of, mi.variant())


@cache
def _derived(methods_of: type, variant: str) -> type:
    methods = {name: member for name, member in vars(methods_of).items() if name not in ("__dict__", "__weakref__")}
    return type(f"{methods_of.__name__}_{variant}", (mi.BSDF,), methods)

"""`miller1984`: Miller & Hoffman (1984) as printed: a diffuse map by the normal, a specular by the reflection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.lobes.facet_moments import cosines
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.miller1984.illumination import illumination_table
from rsibr.methods.miller1984.material_fit import MaterialFit, PhongMaterial
from rsibr.methods.miller1984.polar_table import LOOKUPS, Lookup, PolarTable
from rsibr.methods.miller1984.reflectance import VARNISH, lambert, self_luminous
from rsibr.methods.miller1984.tables import (
    DIFFUSE_ROWS,
    ILLUMINATION_ROWS,
    Sizes,
    diffuse_map,
    highest_exponent,
    phong_rows,
    specular_map,
    specular_reflectance,
)
from rsibr.methods.miller1984.two_maps import TwoMaps
from rsibr.methods.options import Colour, choice, colour, flag, number, table, whole
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.shading_method import MOST_POINTS, POINTS, Shading, ShadingMethod

Array = NDArray[np.float64]

Weights = Sequence[float] | Sequence[Sequence[float]]
"""Weights by view angle, evenly spaced in √cos θ from grazing to head-on: numbers, or one a channel."""

Diffuse = Literal["lambert", "self-luminous"]
"""Diffuse convolution functions of section 6.1."""


class Miller1984(ShadingMethod):
    """Shading by a diffuse map D and a specular map S; Miller & Hoffman (1984), section 3.

    Attributes
    ----------
    material : PhongMaterial
        Constants and weights in use.
    fit : MaterialFit
        Their fit to the lobes of the bake; `fit.error` is the relative error of the angular shape.
    """

    def __init__(
        self, inputs: MethodInputs, shading: Shading, points: int, material: PhongMaterial, fit: MaterialFit
    ) -> None:
        super().__init__(inputs, shading, points)
        self.material, self.fit = material, fit


def two_maps(
    illumination: Array, material: PhongMaterial, sizes: Sizes, lookup: Lookup, diffuse: Diffuse = "lambert"
) -> TwoMaps:
    """Maps D and S of a material under an illumination table, and its weights; options as of `miller1984`."""
    f_d, f_s = lambert() if diffuse == "lambert" else self_luminous(), specular_reflectance(material)
    d = s = None
    if material.k_d.any():
        d = PolarTable.of(diffuse_map(illumination, material.k_d, f_d, sizes.diffuse), lookup)
    if material.k_s.any() or material.mirror:
        rows = sizes.of_specular(material.n, material.mirror)
        glossy_rows = min(rows, phong_rows(material.n, sizes.illumination)) if material.mirror else rows
        s = PolarTable.of(specular_map(illumination, material.k_s, f_s, rows, glossy_rows), lookup)
    return TwoMaps(d, s, CosineTable.of(material.w_d), CosineTable.of(material.w_s))


@register(
    "miller1984",
    summary="Miller & Hoffman (1984): diffuse map by the normal, specular map by the reflection",
    needs=Needs(light=True, lobes=True),
    sees_delta_lights=True,
    rank=70,
)
def miller1984(
    inputs: MethodInputs,
    *,
    k_d: Colour | None = None,
    k_s: Colour | None = None,
    n: float | str | None = None,
    varnish: bool | None = None,
    w_d: Weights | None = None,
    w_s: Weights | None = None,
    diffuse: Diffuse = "lambert",
    lookup: Lookup = "bilinear",
    illumination_rows: int = ILLUMINATION_ROWS,
    diffuse_rows: int = DIFFUSE_ROWS,
    specular_rows: int | None = None,
    points: int = POINTS,
) -> Miller1984:
    """Make the method; what is not given is fitted to the lobes of the bake.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake.
    k_d, k_s : float or three floats, optional
        Diffuse and specular constants.
    n : float or str, optional
        Exponent of Phong's function; infinite, or "inf", for a perfect mirror.
    varnish : bool, optional
        Whether the specular function has the mirror part of a clear varnish coat; by default where the material has a
        delta lobe beside a glossy one.
    w_d, w_s : sequence, optional
        Weights by view angle, at least two: evenly spaced in √cos θ from grazing to head-on.
    diffuse : {"lambert", "self-luminous"}
        Diffuse function.
    lookup : {"bilinear", "nearest"}
        How the maps are read.
    illumination_rows, diffuse_rows, specular_rows : int
        Rows of the tables I, D and S; each has twice as many columns. S has by default those of I if it has a mirror
        part, otherwise as many as its exponent asks for. Sums are quickest where those of I are a multiple of the
        others'.
    points : int
        Points along a side of a map's texel, whose mean the texel shows: the box filter of section 8.1.
    """
    choice("diffuse", diffuse, get_args(Diffuse))
    sizes = checked_sizes(lookup, points, illumination_rows, diffuse_rows, specular_rows)
    fit, material = fitted_material(inputs, sizes, k_d=k_d, k_s=k_s, n=n, varnish=varnish, w_d=w_d, w_s=w_s)
    illumination = illumination_table(inputs.light, sizes.illumination)
    return Miller1984(inputs, two_maps(illumination, material, sizes, lookup, diffuse), points, material, fit)


def checked_sizes(lookup: str, points: int, *rows: int | None) -> Sizes:
    """Sizes of the tables with so many `rows`; raises an InputError if an option makes no sense."""
    choice("lookup", lookup, LOOKUPS)
    whole("points", points, 1, MOST_POINTS)
    return Sizes(*rows)  # type: ignore[arg-type]  # checks them itself


def fitted_material(inputs: MethodInputs, sizes: Sizes, **given: Any) -> tuple[MaterialFit, PhongMaterial]:
    """Fit of the lobes, and the material with what is `given` in place of the fit; names as of `miller1984`."""
    n = _exponent(given["n"], sizes.illumination)
    varnish = None if given["varnish"] is None else flag("varnish", given["varnish"])
    fit = MaterialFit.of(list(inputs.shapes.values()), None if n is None or np.isinf(n) else n)
    fit = replace(fit, n=min(fit.n, highest_exponent(sizes.illumination)))
    material = fit.material()
    if n is not None and np.isinf(n):
        albedo = fit.glossy + fit.mirror
        material = replace(material, n=np.inf, mirror=1.0, k_s=np.ones(3), w_s=albedo)
    if varnish is not None and not np.isinf(material.n):
        material = replace(material, mirror=VARNISH if varnish else 0.0)
    checks: dict[str, Callable[[str, Any], Array]] = {
        "k_d": colour,
        "k_s": colour,
        "w_d": _weights,
        "w_s": _weights,
    }
    changes: dict[str, Any] = {
        name: check(name, given[name]) for name, check in checks.items() if given[name] is not None
    }
    return fit, replace(material, **changes)


def checked_exponent(option: str, n: float, rows: int) -> float:
    """Return an exponent; raise an InputError unless an illumination table of so many rows resolves it."""
    highest = highest_exponent(rows)
    if not number(option, n, above=0.0) <= highest:
        what = f"{n:g} is more than {highest:.0f}, where a lobe is as wide as a texel of the illumination table"
        raise InputError(what, where=f"option {option}", fix="give more illumination_rows; n = inf is a perfect mirror")
    return float(n)


def _exponent(n: float | str | None, rows: int) -> float | None:
    """Exponent that was given, infinite for a mirror."""
    if n is None or n in (np.inf, "inf"):
        return None if n is None else np.inf
    return checked_exponent("n", n, rows)  # type: ignore[arg-type]  # checks it


def _weights(name: str, value: Weights) -> Array:
    array = table(name, value)
    place = np.linspace(0, 1, len(array))
    return np.stack([np.interp(np.sqrt(cosines()), place, channel) for channel in array.T], axis=1)

"""Method of Kautz, Daubert, Seidel (2003) as published: (1 − F)·diffuse + F·glossy from a filtered environment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from rsibr import backend
from rsibr.geometry.projections.projection import projection
from rsibr.light.projected import light_in
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.kautz2003.faces import Faces
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.material_fit import KautzMaterial, Lobes
from rsibr.methods.kautz2003.nine_coefficients import FACE
from rsibr.methods.kautz2003.schlick_mix import SchlickMix
from rsibr.methods.options import Colour, choice, colour, flag, number, power_of_two, whole
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.shading_method import MOST_POINTS, POINTS, ShadingMethod

FILTERS = ("box", "phong")
"""Filters of the glossy cube: the paper's own, and the one that it is compared with."""

SIZE, MOST_SIZE = 256, 2048
"""Texels a side of the cube's finest level: by default, and at most, 400 MB on the device."""


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "f_lambda": partial(colour, most=1.0),
    "k_d": colour,
    "k_s": colour,
    "bias": number,
    "exponent": partial(number, above=0.0),
}
"""Checks of the parameters that a user may give in place of the fit."""


class Kautz2003(ShadingMethod):
    """Nine coefficients by the normal and a filtered cube by the direction of reflection, mixed by Schlick's term.

    Attributes
    ----------
    material : KautzMaterial
        Parameters of the reflection model, with the errors of their fit.
    light : KautzLight
        Filtered environment.
    filtering : dict
        Options of `KautzLight.of` that `light` was made with.
    """

    name = "kautz2003"

    def __init__(
        self, inputs: MethodInputs, points: int, material: KautzMaterial, light: KautzLight, filtering: dict[str, Any]
    ) -> None:
        super().__init__(inputs, SchlickMix.of(material, light), points)
        self.material, self.light, self.filtering = material, light, filtering

    @backend.in_session
    def refiltered(self, faces: Faces) -> Kautz2003:
        """Return the same material under another environment.

        Parameters
        ----------
        faces : ndarray, shape (6, N, N, 3)
            See `KautzLight.of`. With N as before, no kernel is compiled anew.
        """
        light = KautzLight.of(faces, **self.filtering)
        other = Kautz2003(self.inputs, self.points, self.material, light, self.filtering)
        other.name, other.cost = self.name, self.cost
        return other


@register(
    "kautz2003",
    summary="Kautz et al. (2003): nine harmonic coefficients, and a box-filtered cube with a bias",
    needs=Needs(light=True, lobes=True),
    rank=75,
)
def kautz2003(
    inputs: MethodInputs,
    *,
    filter: str = "box",
    bias: float | None = None,
    exponent: float | None = None,
    f_lambda: Colour | None = None,
    k_d: Colour | None = None,
    k_s: Colour | None = None,
    borders: bool = False,
    size: int = SIZE,
    coefficients_face: int = FACE,
    points: int = POINTS,
) -> Kautz2003:
    """Make the method. What is None is fitted to the material; see `KautzMaterial`.

    Parameters
    ----------
    inputs : MethodInputs
        Environment and lobes of a bake.
    filter : {"box", "phong"}
        Filter of the glossy cube: MIP levels of 2×2 boxes, or Phong's lobe by quadrature.
    bias : float, optional
        Level of detail b of the box-filtered cube. The hardware's level is log₂(texels under a pixel) + b; a point has
        no extent, so that here b counts from the finest level.
    exponent : float, optional
        Exponent N > 0 of Phong's lobe.
    f_lambda, k_d, k_s : float or three, optional
        Schlick's reflectance at normal incidence; diffuse and glossy reflectance of the light that F hands to each.
    borders : bool
        Whether lookups are filtered across the borders of faces. The hardware of 2003 did not.
    size : int
        Texels a side of the finest level, a power of two.
    coefficients_face : int
        Texels a side of the faces that the nine coefficients are computed from, a power of two.
    points : int
        Points along a side of a map's texel, whose mean the texel shows.
    """
    is_phong = choice("filter", filter, FILTERS) == "phong"
    sizes = power_of_two("size", size, MOST_SIZE), power_of_two("coefficients_face", coefficients_face, MOST_SIZE)
    values = {"f_lambda": f_lambda, "k_d": k_d, "k_s": k_s, "bias": bias, "exponent": exponent}
    given = {name: check(name, values[name]) for name, check in _CHECKS.items() if values[name] is not None}
    fit = KautzMaterial.fitted(Lobes.of(inputs.shapes), sizes[0])
    material = replace(fit, **given)
    filtering: dict[str, Any] = {
        "coefficients_face": sizes[1],
        "borders": flag("borders", borders),
        "exponent": material.exponent if is_phong else None,
    }
    faces = light_in(inputs.light, projection("cube"), size)
    side = whole("points", points, 1, MOST_POINTS)
    return Kautz2003(inputs, side, material, KautzLight.of(faces, **filtering), filtering)

"""Method of Kautz, Daubert, Seidel (2003) as published: (1 − F)·diffuse + F·glossy from a filtered environment."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi

from rsibr import backend
from rsibr.geometry.projections.projection import projection
from rsibr.light.projected import light_in
from rsibr.lobes.microfacet import schlick
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.kautz2003.faces import Faces
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.material_fit import KautzMaterial, Lobes
from rsibr.methods.kautz2003.nine_coefficients import FACE
from rsibr.methods.kautz2003.options import Colour, choice, colour, flag, number, side
from rsibr.methods.protocol import Needs, PointwiseMethod
from rsibr.methods.registry import register

FILTERS = ("box", "phong")
"""Filters of the glossy cube: the paper's own, and the one that it is compared with."""

SIZE = 256
"""Texels a side of the cube's finest level."""


class Kautz2003(PointwiseMethod):
    """Nine coefficients by the normal and a filtered cube by the direction of reflection, mixed by Schlick's term.

    Parameters
    ----------
    material : KautzMaterial
        Parameters of the reflection model.
    light : KautzLight
        Filtered environment.
    filtering : dict
        Options of `KautzLight.of` that `light` was made with.

    Attributes
    ----------
    material, light
        As given.
    """

    name = "kautz2003"

    def __init__(self, material: KautzMaterial, light: KautzLight, filtering: dict[str, Any]) -> None:
        self.material, self.light, self.filtering = material, light, filtering
        colours = (material.f_lambda, material.k_d, material.k_s)
        self._f, self._k_d, self._k_s = (mi.Color3f(*(float(value) for value in one)) for one in colours)
        self._level = mi.Float(material.bias)
        dr.make_opaque(self._f, self._k_d, self._k_s, self._level)

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """See `Method.eval`; Kautz et al. (2003), eq. 8."""
        cosine = dr.dot(n, v)
        fresnel = dr.fma(1 - self._f, schlick(cosine), self._f)
        diffuse, glossy = self.light.radiance(n, 2 * cosine * n - v, self._level)
        return (1 - fresnel) * self._k_d * diffuse + fresnel * self._k_s * glossy

    @backend.in_session
    def refiltered(self, faces: Faces) -> Kautz2003:
        """Return the same material under another environment.

        Parameters
        ----------
        faces : ndarray, shape (6, N, N, 3)
            See `KautzLight.of`. With N as before, no kernel is compiled anew.
        """
        other = Kautz2003(self.material, KautzLight.of(faces, **self.filtering), self.filtering)
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
    """
    is_phong = choice("filter", filter, FILTERS) == "phong"
    sizes = side("size", size), side("coefficients_face", coefficients_face)
    given: dict[str, Any] = {
        "f_lambda": colour("f_lambda", f_lambda, most=1.0),
        "k_d": colour("k_d", k_d),
        "k_s": colour("k_s", k_s),
        "bias": number("bias", bias),
        "exponent": number("exponent", exponent, above=0.0),
    }
    fit = KautzMaterial.fitted(Lobes.of(inputs.shapes), sizes[0])
    material = replace(fit, **{name: value for name, value in given.items() if value is not None})
    filtering: dict[str, Any] = {
        "coefficients_face": sizes[1],
        "borders": flag("borders", borders),
        "exponent": material.exponent if is_phong else None,
    }
    faces = light_in(inputs.light, projection("cube"), size)
    return Kautz2003(material, KautzLight.of(faces, **filtering), filtering)

"""Mix of diffuse and glossy reflection by Schlick's term; Kautz et al. (2003), eq. 8."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.lobes.microfacet import schlick
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.material_fit import KautzMaterial


@dataclass(eq=False)
class SchlickMix:
    """Shading (1 − F)·k_d·(diffuse) + F·k_s·(glossy) with F = f_λ + (1 − f_λ)(1 − cos θ)⁵.

    Attributes
    ----------
    f_lambda, k_d, k_s : mi.Color3f
        Schlick's reflectance at normal incidence, diffuse and glossy reflectance (opaque).
    level : mi.Float
        Level of detail of the glossy cube (opaque).
    light : KautzLight
        Filtered environment.
    """

    f_lambda: mi.Color3f
    k_d: mi.Color3f
    k_s: mi.Color3f
    level: mi.Float
    light: KautzLight

    @classmethod
    def of(cls, material: KautzMaterial, light: KautzLight) -> SchlickMix:
        """Put the parameters of a material on the device."""
        colours = (material.f_lambda, material.k_d, material.k_s)
        f_lambda, k_d, k_s = (mi.Color3f(*(float(value) for value in one)) for one in colours)
        level = mi.Float(material.bias)
        dr.make_opaque(f_lambda, k_d, k_s, level)
        return cls(f_lambda, k_d, k_s, level, light)

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine = dr.dot(n, v)
        fresnel = dr.fma(1 - self.f_lambda, schlick(cosine), self.f_lambda)
        diffuse, glossy = self.light.radiance(n, 2 * cosine * n - v, self.level)
        return (1 - fresnel) * self.k_d * diffuse + fresnel * self.k_s * glossy

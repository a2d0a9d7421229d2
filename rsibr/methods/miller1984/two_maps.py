"""Shading by a diffuse and a specular map; Miller & Hoffman (1984), section 3."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.miller1984.polar_table import PolarTable


@dataclass(eq=False)
class TwoMaps:
    """Shading W_d(E·N) D[N] + W_s(E·N) S[R] with R = 2(E·N)N − E; Miller & Hoffman (1984), section 3.

    Attributes
    ----------
    diffuse, specular : PolarTable or None
        Maps D and S; None where their constant is zero.
    w_d, w_s : CosineTable
        Weights W_d and W_s.
    """

    diffuse: PolarTable | None
    specular: PolarTable | None
    w_d: CosineTable
    w_s: CosineTable

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine = dr.dot(n, v)
        radiance = mi.Color3f(0 * cosine)
        if self.diffuse is not None:
            radiance += self.w_d.colour(cosine) * self.diffuse.fetch(n)
        if self.specular is not None:
            radiance += self.w_s.colour(cosine) * self.specular.fetch(2 * cosine * n - v)
        return radiance

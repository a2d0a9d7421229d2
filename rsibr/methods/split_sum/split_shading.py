"""What the split sum looks up, and how: for each glossy lobe a prefiltered cube times an albedo, and irradiance."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.light.harmonic_irradiance import HarmonicIrradiance
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.split_sum.delta_highlights import DeltaHighlights
from rsibr.methods.split_sum.prefiltered_cube import PrefilteredCube


@dataclass(eq=False)
class GlossyLobe:
    """One prefiltered cube and its factor.

    Attributes
    ----------
    cube : PrefilteredCube
        Environment prefiltered for the lobe's roughness, indexed by the mirror direction.
    albedo : CosineTable
        Directional albedo by the cosine of the view angle.
    """

    cube: PrefilteredCube
    albedo: CosineTable


@dataclass(eq=False)
class SplitShading:
    """What is looked up, on the device.

    Attributes
    ----------
    glossy : list of GlossyLobe
        Split sums that are added.
    diffuse : CosineTable
        Albedo of all that follows the normal, by the cosine of the view angle.
    irradiance : HarmonicIrradiance
        Irradiance by the normal.
    highlights : DeltaHighlights or None
        Reflections of delta lights; None if there are no such lights.
    """

    glossy: list[GlossyLobe]
    diffuse: CosineTable
    irradiance: HarmonicIrradiance
    highlights: DeltaHighlights | None

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine = dr.dot(n, v)
        mirrored = 2 * cosine * n - v
        total = self.diffuse.colour(cosine) * self.irradiance.mean_radiance(n)
        for lobe in self.glossy:
            total += lobe.albedo.colour(cosine) * lobe.cube.lookup(mirrored)
        return total if self.highlights is None else total + self.highlights.radiance(n, v)

"""Light of a matte part of a lobe: an irradiance map indexed by the normal, times its share of the albedo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mitsuba as mi

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.lobe_terms import MatteTerm


@dataclass(eq=False)
class MatteLight:
    """One matte part on the device.

    Attributes
    ----------
    irradiance : EnvironmentPyramid
        Irradiance map in one level, normalised to a mean radiance.
    share : CosineTable
        Its share of the albedo by cos θ.
    """

    irradiance: EnvironmentPyramid
    share: CosineTable

    @classmethod
    def of(cls, terms: Sequence[MatteTerm], light: Light) -> list[MatteLight]:
        """Put the matte parts that have a share on the device."""
        return [
            cls(EnvironmentPyramid.of_irradiance(light.irradiance(term.weights)), CosineTable.of(term.share))
            for term in terms
            if term.share.any()
        ]

    def radiance(self, n: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        """Reflected radiance [W sr⁻¹ m⁻²] at world normals `n` seen under `cosine`."""
        return self.share.colour(cosine) * self.irradiance.fetch(n, mi.UInt32(0))

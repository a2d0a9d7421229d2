"""Reflections of delta lights by the fitted lobes, in closed form, as engines shade punctual lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.light.delta_lights_on_device import DeltaLightsOnDevice
from rsibr.light.radiance import Light
from rsibr.lobes.basis import ggx
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.split_sum.material_fit import LobeFit


@dataclass(eq=False)
class DeltaHighlights:
    """Delta lights, and the GGX lobes and the matte parts that reflect them.

    Attributes
    ----------
    lights : DeltaLightsOnDevice
        Delta lights.
    lobes : list of (mi.Float, mi.Color3f, mi.Color3f)
        α, F₀ and F₉₀ of each glossy lobe (opaque). A delta lobe reflects no delta light.
    diffuse : CosineTable
        Albedo of all matte parts by the cosine of the view angle.
    """

    lights: DeltaLightsOnDevice
    lobes: list[tuple[mi.Float, mi.Color3f, mi.Color3f]]
    diffuse: CosineTable

    @classmethod
    def of(cls, light: Light, fits: Sequence[LobeFit], diffuse: CosineTable) -> DeltaHighlights | None:
        """Put the delta lights of a bake and its fitted lobes on the device; None if there are no such lights."""
        if light.delta.is_black:
            return None
        glossy = [fit for fit in fits if fit.alpha > 0 and fit.exact.any()]
        lobes = [(mi.Float(fit.alpha), mi.Color3f(*fit.f0.tolist()), mi.Color3f(*fit.f90.tolist())) for fit in glossy]
        dr.make_opaque(lobes)
        return cls(DeltaLightsOnDevice.of(light.delta), lobes, diffuse)

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance [W sr⁻¹ m⁻²] toward `v` from surfaces with normal `n`, unit vectors in world coordinates."""
        frame = mi.Frame3f(n)
        toward = frame.to_local(v)
        matte = self.diffuse.colour(toward.z) * dr.inv_pi

        def add(k: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
            d, irradiance = self.lights.at(k)
            incident = frame.to_local(d)
            reflected = matte * dr.maximum(incident.z, 0)
            for alpha, head_on, grazing in self.lobes:
                plain, graze = ggx(incident, toward, alpha)
                reflected += head_on * (plain - graze) + grazing * graze
            return k + 1, total + dr.select(incident.z > 0, reflected * irradiance, 0)

        _, total = dr.while_loop(
            state=(mi.UInt32(0), dr.zeros(mi.Color3f, dr.width(n))),
            cond=lambda k, _total: k < self.lights.count,
            body=add,
            labels=("k", "total"),
            label="delta_highlights",
        )
        return total

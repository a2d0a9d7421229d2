"""Delta lights on the device, fetched one at a time by kernels that sum over them."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.to_device import to_device
from rsibr.light.delta_lights import DeltaLights


@dataclass(eq=False)
class DeltaLightsOnDevice:
    """Directions and irradiances of delta lights.

    Attributes
    ----------
    packets : mi.Float
        Direction and irradiance of each light, two packets of four floats, flat.
    count : mi.UInt32
        Number of lights (opaque).
    """

    packets: mi.Float
    count: mi.UInt32

    @classmethod
    def of(cls, lights: DeltaLights) -> DeltaLightsOnDevice:
        """Put lights on the device."""
        rows = np.zeros((len(lights), 2, 4), dtype=np.float32)
        rows[:, 0, :3], rows[:, 1, :3] = lights.directions, lights.irradiance
        return cls(to_device(mi.Float, rows), dr.opaque(mi.UInt32, len(rows)))

    def at(self, index: mi.UInt32) -> tuple[mi.Vector3f, mi.Color3f]:
        """Fetch the unit direction to a light, and the irradiance [W m⁻²] of a surface that faces it."""
        d, energy = (dr.gather(mi.Vector4f, self.packets, 2 * index + row) for row in range(2))
        return mi.Vector3f(d.x, d.y, d.z), mi.Color3f(energy.x, energy.y, energy.z)

"""`rsibr` for single pairs of normal and view: narrow Gaussians integrated per point, wide ones from view nodes."""

from __future__ import annotations

from dataclasses import dataclass, field

import mitsuba as mi

from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.polar_grid import PolarGrid
from rsibr.methods.rsibr.residual_method import ResidualMethod


@dataclass(eq=False, repr=False)
class RsibrPoints(ResidualMethod):
    """Prediction P integrated per point, plus residuals; docs/method.md, section 9.

    The residuals are those of the same integral as a mean over texels, as the stored maps hold it.

    Attributes
    ----------
    integral : LobeIntegral
        Reflection integral of all lobes.
    """

    integral: LobeIntegral = field(kw_only=True)

    def _predicted_at(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        return self.integral.radiance(n, v)

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> PolarGrid | None:  # noqa: ARG002
        return self.integral.grid(frame)

    def _predicted(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: PolarGrid | None, resolution: int, *, mirror: bool = True
    ) -> mi.Color3f:
        return self.integral.radiance_in_map(n, frame, tables, mi.Float(2 / resolution), mirror)

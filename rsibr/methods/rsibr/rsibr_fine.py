"""`rsibr-fine`: prediction P integrated per lobe and texel, plus residuals; slower, more accurate than `rsibr`."""

from __future__ import annotations

from dataclasses import dataclass, field

import mitsuba as mi

from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.polar_grid import PolarGrid
from rsibr.methods.rsibr.residual_method import ResidualMethod, ResidualOptions, residual_method


@dataclass(eq=False, repr=False)
class RsibrFine(ResidualMethod):
    """Prediction P with every narrow Gaussian integrated per texel; docs/method.md, section 6.

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


@register(
    "rsibr-fine",
    summary="rsibr with every lobe integrated per texel: more accurate, many times slower",
    needs=Needs(light=True, lobes=True),
    sees_delta_lights=True,
    rank=60,
)
def rsibr_fine(
    inputs: MethodInputs, *, weights: str = "gnomonic", uses_maps: bool | None = None, lobe: str | None = None
) -> RsibrFine:
    """Make the method `rsibr-fine`.

    Parameters
    ----------
    inputs : MethodInputs
        Maps, environment and lobes of a bake.
    weights : str
        Barycentric weights of the residuals, one of `WEIGHTS`.
    uses_maps, lobe
        See `ResidualOptions`.
    """
    options = ResidualOptions(inputs, uses_maps, lobe)
    return residual_method(RsibrFine, "rsibr-fine", options, weights, integral=lobe_integral(options))


def lobe_integral(options: ResidualOptions) -> LobeIntegral:
    """Reflection integral of all lobes, or of `options.lobe` where that is set."""
    inputs = options.inputs
    part = inputs.shapes[options.lobe][0] if options.lobe else None
    lobes = list(inputs.shapes.values())
    return LobeIntegral.of(lobes, inputs.pyramid, inputs.light, part, options.mirror_density)

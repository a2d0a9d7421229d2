"""`rsibr-fine`: prediction P integrated per lobe and texel, plus residuals; slower, more accurate than `rsibr`."""

from __future__ import annotations

from dataclasses import dataclass, field

import mitsuba as mi

from rsibr.methods.inputs import MethodInputs
from rsibr.methods.lobe_albedo import LobeAlbedo
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.polar_grid import PolarGrid
from rsibr.methods.rsibr.residual_method import ResidualMethod, ResidualOptions, residual_method


@dataclass(eq=False, repr=False)
class RsibrFine(ResidualMethod):
    """Prediction P = Σ_k E_k P_k/E_k with the reflection integral of each lobe; docs/method.md, section 6.

    Attributes
    ----------
    lobes : list of (LobeIntegral, LobeAlbedo)
        Reflection integral P_k/E_k of each lobe, and its directional albedo E_k.
    """

    lobes: list[tuple[LobeIntegral, LobeAlbedo]] = field(default_factory=list)

    def _predicted_at(self, n: mi.Vector3f, v: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        radiance = mi.Color3f(0)
        for integral, albedo in self.lobes:
            radiance += albedo.at(cosine) * integral.radiance(n, v)
        return radiance

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> list[PolarGrid | None]:  # noqa: ARG002
        return [integral.grid(frame) if integral.has_grid else None for integral, _ in self.lobes]

    def _predicted(
        self,
        n: mi.Vector3f,
        frame: mi.Matrix3f,
        tables: list[PolarGrid | None],
        resolution: int,
        *,
        mirror: bool = True,
    ) -> mi.Color3f:
        radiance = mi.Color3f(0)
        for (integral, albedo), grid in zip(self.lobes, tables, strict=True):
            if integral.mirrored is not None and not mirror:
                continue
            radiance += albedo.at(n.z) * integral.radiance_in_map(n, frame, grid, mi.Float(2 / resolution))
        return radiance


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
    return residual_method(RsibrFine, "rsibr-fine", options, weights, lobes=lobe_integrals(options))


def lobe_integrals(options: ResidualOptions) -> list[tuple[LobeIntegral, LobeAlbedo]]:
    """Reflection integral and directional albedo of each lobe, or only of `options.lobe` where that is set."""
    inputs, density = options.inputs, options.mirror_density
    chosen = [inputs.shapes[options.lobe]] if options.lobe else list(inputs.shapes.values())
    return [
        (LobeIntegral.of(shape, inputs.pyramid, inputs.light, density), LobeAlbedo.of(albedo))
        for shape, albedo in chosen
    ]

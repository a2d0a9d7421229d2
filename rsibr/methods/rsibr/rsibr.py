"""`rsibr`: prediction P from a half-vector pyramid (maps) or integrated (single points), plus warped residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mitsuba as mi

from rsibr import backend
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.half_vector_lobes import FAST, Fidelity, HalfVectorLobes, MapTables
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.residual_method import ResidualMethod, ResidualOptions, residual_method
from rsibr.methods.rsibr.rsibr_points import RsibrPoints


@dataclass(eq=False, repr=False)
class Rsibr(ResidualMethod):
    """Prediction P from one half-vector pyramid for all texels of a map, plus residuals.

    Attributes
    ----------
    lobes : HalfVectorLobes
        All lobes, prepared for maps.
    points : callable
        Makes the method for single points; called at the first `eval`.
    """

    lobes: HalfVectorLobes = field(kw_only=True)
    points: Callable[[], RsibrPoints] = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._points: RsibrPoints | None = None  # not a field: the recorded kernels of maps do not depend on it

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`.

        A pyramid serves all texels of one view and does not help where every pixel has its own: single points have
        another prediction, with residuals of its own; see `RsibrPoints`.
        """
        if self._points is None:
            with self._preparing():
                self._points = self.points()
        return self._points.eval(n, v)

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> MapTables:  # noqa: ARG002
        return self.lobes.tables(frame)

    def _predicted(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: MapTables, resolution: int, *, mirror: bool = True
    ) -> mi.Color3f:
        return self.lobes.radiance(n, frame, tables, mi.Float(2 / resolution), mirror)


@register(
    "rsibr",
    summary="prediction of all lobes from the environment, plus warped residuals of the stored maps",
    needs=Needs(light=True, lobes=True),
    sees_delta_lights=True,
    role="default",
    rank=50,
)
def rsibr(
    inputs: MethodInputs, *, weights: str = "gnomonic", uses_maps: bool | None = None, lobe: str | None = None
) -> Rsibr:
    """Make the method `rsibr`.

    Parameters
    ----------
    inputs : MethodInputs
        Maps, environment and lobes of a bake.
    weights : str
        Barycentric weights of the residuals, one of `WEIGHTS`.
    uses_maps, lobe
        See `ResidualOptions`.
    """
    return model_with_residuals("rsibr", inputs, FAST, weights, uses_maps, lobe)


def model_with_residuals(
    name: str, inputs: MethodInputs, fidelity: Fidelity, weights: str, uses_maps: bool | None, lobe: str | None
) -> Rsibr:
    """Make a method of the name, whose model gathers light as finely as `fidelity`; parameters as of `rsibr`."""
    options = ResidualOptions(inputs, uses_maps, lobe)
    lobes, part = list(inputs.shapes.values()), inputs.shapes[lobe][0] if lobe else None
    pyramid, light, density = inputs.pyramid, inputs.light, options.mirror_density
    prepared = HalfVectorLobes.of(lobes, pyramid, light, part, density, fidelity)

    def points() -> RsibrPoints:
        integral = LobeIntegral.of(lobes, pyramid, light, part, density)
        return residual_method(RsibrPoints, name, options, weights, integral=integral)

    return residual_method(Rsibr, name, options, weights, lobes=prepared, points=points)

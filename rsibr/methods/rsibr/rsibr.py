"""`rsibr`: prediction from a half-vector pyramid for whole maps, from view nodes for single points, plus residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mitsuba as mi

from rsibr import backend
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.half_vector_lobes import HalfVectorLobes
from rsibr.methods.rsibr.residual_method import ResidualMethod, ResidualOptions, residual_method
from rsibr.methods.rsibr.rsibr_fine import RsibrFine, lobe_integrals
from rsibr.methods.rsibr.view_nodes import ViewNodes


@dataclass(eq=False, repr=False)
class RsibrPoints(RsibrFine):
    """`rsibr` for single pairs of normal and view: wide parts of the lobes from view nodes, narrow parts per point.

    Its residuals are those of `rsibr-fine`, of means over texels as the stored maps hold them.

    Attributes
    ----------
    nodes : list of (ViewNodes or None)
        Wide part of each of `lobes`, tabulated; None where it has none.
    """

    nodes: list[ViewNodes | None] = field(default_factory=list)

    def _predicted_at(self, n: mi.Vector3f, v: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        radiance = mi.Color3f(0)
        for (integral, albedo), nodes in zip(self.lobes, self.nodes, strict=True):
            radiance += albedo.at(cosine) * integral.radiance(n, v, nodes.lookup if nodes else None)
        return radiance


@dataclass(eq=False, repr=False)
class Rsibr(ResidualMethod):
    """Prediction from one half-vector pyramid for all texels of a map.

    Attributes
    ----------
    prefilter : callable
        Resolution of a map → the lobes, prepared for it.
    points : callable
        Makes the evaluation of single points, when it is first asked for.
    """

    prefilter: Callable[[int], HalfVectorLobes] = field(kw_only=True)
    points: Callable[[], RsibrPoints] = field(kw_only=True)
    _lobes: dict[int, HalfVectorLobes] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._points: RsibrPoints | None = None  # no field: recorded kernels of maps do not read it

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        if self._points is None:
            with self._preparing():
                self._points = self.points()
        return self._points.eval(n, v)

    def _prepare(self, resolution: int) -> None:
        if resolution not in self._lobes:
            with self._preparing():
                self._lobes[resolution] = self.prefilter(resolution)

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> mi.Float:
        return self._lobes[resolution].gathered(frame)

    def _predicted(self, n: mi.Vector3f, frame: mi.Matrix3f, tables: mi.Float, resolution: int) -> mi.Color3f:
        return self._lobes[resolution].radiance(n, frame, tables, mi.Float(2 / resolution))


@register(
    "rsibr",
    summary="ours: all lobes predicted from the light, plus the warped residuals of the stored maps",
    needs=Needs(light=True, lobes=True),
    role="default",
    rank=50,
)
def rsibr(
    inputs: MethodInputs, *, weights: str = "gnomonic", uses_maps: bool | None = None, lobe: str | None = None
) -> Rsibr:
    """Make the method.

    Parameters
    ----------
    inputs : MethodInputs
        Maps, light and lobes of a bake.
    weights : str
        Barycentric weights of the residuals, one of `WEIGHTS`.
    uses_maps, lobe
        See `ResidualOptions`.
    """
    options = ResidualOptions(inputs, uses_maps, lobe)
    lobes, part = list(inputs.shapes.values()), inputs.shapes[lobe][0] if lobe else None
    pyramid, light, density = inputs.pyramid, inputs.light, options.mirror_density

    def points() -> RsibrPoints:
        integrals = lobe_integrals(options)
        nodes = [ViewNodes.of(integral) if integral.has_grid else None for integral, _ in integrals]
        return residual_method(RsibrPoints, "rsibr", options, weights, lobes=integrals, nodes=nodes)

    return residual_method(
        Rsibr,
        "rsibr",
        options,
        weights,
        prefilter=lambda resolution: HalfVectorLobes.of(lobes, pyramid, light, resolution, part, density),
        points=points,
    )

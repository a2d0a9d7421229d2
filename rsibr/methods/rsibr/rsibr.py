"""`rsibr`: prediction P from a half-vector pyramid (maps) or view nodes (single points), plus warped residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mitsuba as mi

from rsibr import backend
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.half_vector_lobes import HalfVectorLobes
from rsibr.methods.rsibr.half_vector_pyramid import finest_resolution
from rsibr.methods.rsibr.residual_method import ResidualMethod, ResidualOptions, residual_method
from rsibr.methods.rsibr.rsibr_fine import RsibrFine, lobe_integrals
from rsibr.methods.rsibr.view_nodes import ViewNodes


@dataclass(eq=False, repr=False)
class RsibrPoints(RsibrFine):
    """`rsibr` for single pairs of normal and view: wide Gaussians from view nodes, narrow ones integrated per point.

    The residuals are those of `rsibr-fine`, which predicts means over texels, as the stored maps hold them
    (docs/method.md, section 9).

    Attributes
    ----------
    nodes : list of (ViewNodes or None)
        Tabulated wide part of each of `lobes`; None for a lobe without wide Gaussians.
    """

    nodes: list[ViewNodes | None] = field(default_factory=list)

    def _predicted_at(self, n: mi.Vector3f, v: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        radiance = mi.Color3f(0)
        for (integral, albedo), nodes in zip(self.lobes, self.nodes, strict=True):
            radiance += albedo.at(cosine) * integral.radiance(n, v, nodes.lookup if nodes else None)
        return radiance


@dataclass(eq=False, repr=False)
class Rsibr(ResidualMethod):
    """Prediction P from one half-vector pyramid for all texels of a map, plus residuals.

    Attributes
    ----------
    prefilter : callable
        Resolution of a map → lobes prepared for that resolution.
    points : callable
        Makes the method for single points; called at the first `eval`.
    """

    prefilter: Callable[[int], HalfVectorLobes] = field(kw_only=True)
    points: Callable[[], RsibrPoints] = field(kw_only=True)
    _lobes: HalfVectorLobes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        # Not a field: a recording must only see the lobes of its own resolution, or each new one would record all anew
        self._lobes_by_size: dict[int, HalfVectorLobes] = {}
        self._points: RsibrPoints | None = None  # not a field: the recorded kernels of maps do not depend on it

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        if self._points is None:
            with self._preparing():
                self._points = self.points()
        return self._points.eval(n, v)

    def _prepare(self, resolution: int) -> None:
        finest = finest_resolution(resolution)
        if finest not in self._lobes_by_size:
            with self._preparing():
                self._lobes_by_size[finest] = self.prefilter(resolution)
        self._lobes = self._lobes_by_size[finest]

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> mi.Float:  # noqa: ARG002
        return self._lobes.gathered(frame)

    def _predicted(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: mi.Float, resolution: int, *, mirror: bool = True
    ) -> mi.Color3f:
        return self._lobes.radiance(n, frame, tables, mi.Float(2 / resolution), mirror)


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

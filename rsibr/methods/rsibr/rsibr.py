"""`rsibr`: prediction P from a half-vector pyramid (maps) or integrated (single points), plus warped residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mitsuba as mi

from rsibr import backend
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.lobe_terms import Lobe
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.belief import Belief, Image, StoredView, judged, learnt
from rsibr.methods.rsibr.fidelity import FAST, Fidelity
from rsibr.methods.rsibr.half_vector_lobes import HalfVectorLobes, LobesOfMaps, MapTables
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.residual_method import ResidualMethod, ResidualOptions, residual_method
from rsibr.methods.rsibr.rsibr_points import RsibrPoints


@dataclass(eq=False, repr=False)
class Rsibr(ResidualMethod):
    """Prediction P from one half-vector pyramid for all texels of a map, plus residuals.

    Attributes
    ----------
    lobes_of_maps : callable
        Makes all lobes for maps of so many texels a side; see `HalfVectorLobes.of`.
    lobes : HalfVectorLobes or None
        Those for the map at hand.
    points : callable
        Makes the method for single points; called at the first `eval`. None for a method that serves maps alone.
    """

    lobes_of_maps: LobesOfMaps = field(kw_only=True)
    lobes: HalfVectorLobes | None = field(default=None, init=False)
    points: Callable[[], RsibrPoints] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        # Not fields: a recording must only see the lobes of its own resolution, and no points
        self._points: RsibrPoints | None = None
        self._lobes: dict[int, HalfVectorLobes] = {}

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`.

        A pyramid serves all texels of one view and does not help where every pixel has its own: single points have
        another prediction, with residuals of its own; see `RsibrPoints`.
        """
        if self._points is None:
            assert self.points is not None
            with self._preparing():
                self._points = self.points()
        return self._points.eval(n, v)

    def _prepare(self, resolution: int) -> None:
        if resolution not in self._lobes:
            with self._preparing():
                self._lobes[resolution] = self.lobes_of_maps(resolution)
        self.lobes = self._lobes[resolution]

    def _map_tables(self, frame: mi.Matrix3f, resolution: int) -> MapTables:  # noqa: ARG002
        assert self.lobes is not None
        return self.lobes.tables(frame)

    def _predicted(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: MapTables, resolution: int, *, mirror: bool = True
    ) -> mi.Color3f:
        assert self.lobes is not None
        return self.lobes.radiance(n, frame, tables, resolution, mirror)


@register(
    "rsibr",
    summary="prediction of all lobes from the environment, plus warped residuals of the stored maps",
    needs=Needs(light=True, lobes=True, maps=True),
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
    belief, known = believed(options, fidelity) if options.carries else (None, None)
    lobes = scaled_lobes(inputs, belief)
    part = lobes[lobe][0] if lobe else None
    model = list(lobes.values()), inputs.pyramid, inputs.light, part, options.mirror_density
    is_known = known is not None and lobe is None and belief is not None and belief.is_full
    prepared = known if is_known else HalfVectorLobes.of(*model, fidelity)

    def points() -> RsibrPoints:
        integral = LobeIntegral.of(*model)
        integral.prepare_points()  # made while points are traced, they would split the first kernel
        return residual_method(RsibrPoints, name, options, weights, belief, integral=integral)

    return residual_method(Rsibr, name, options, weights, belief, lobes_of_maps=prepared, points=points)


def believed(options: ResidualOptions, fidelity: Fidelity) -> tuple[Belief, LobesOfMaps | None]:
    """How much of the whole model and its residuals to believe, learnt once for a bake; see `belief.py`.

    Returns
    -------
    belief : Belief
    model : callable or None
        The whole model, the first time.
    """
    inputs, model = options.inputs, None
    if fidelity not in inputs.learnt:
        model, inputs.learnt[fidelity] = _learnt(ResidualOptions(inputs, uses_maps=True), fidelity)
    belief: Belief = inputs.learnt[fidelity]
    return belief, model


def _learnt(options: ResidualOptions, fidelity: Fidelity) -> tuple[LobesOfMaps, Belief]:
    inputs, lobes = options.inputs, list(options.inputs.shapes.values())
    neighbours = judged(inputs.viewpoints.triangles, inputs.bake.view_count)
    used = sorted({index for view, around in neighbours.items() for index in (view, *around)})

    def model_of(part: LobeShape | None) -> LobesOfMaps:
        return HalfVectorLobes.of(lobes, inputs.pyramid, inputs.light, part, options.mirror_density, fidelity)

    def predicted(model: LobesOfMaps) -> dict[int, tuple[Image, Image]]:
        alone = ResidualOptions(inputs, uses_maps=False)
        method = residual_method(Rsibr, "", alone, "gnomonic", lobes_of_maps=model)
        method.carries_mirror = options.separate_mirror is None
        return {k: method.predicted_at_texels(inputs.maps[k].frame, inputs.bake.resolution) for k in used}

    def of_view(index: int, radiance: Image, albedo: Image) -> StoredView:
        seen = inputs.maps[index]
        return StoredView(options.carried_image(seen), radiance, albedo, seen.coverage > 0, seen.frame)

    def by_lobe() -> list[dict[int, Image]]:
        return [{k: image for k, (image, _) in predicted(model_of(shape)).items()} for shape, _ in lobes]

    whole = model_of(None)
    views = {index: of_view(index, *found) for index, found in predicted(whole).items()}
    return whole, learnt(views, neighbours, len(lobes), by_lobe)


def scaled_lobes(inputs: MethodInputs, belief: Belief | None) -> dict[str, Lobe]:
    """Lobes by name, their albedos multiplied by the factors of a belief."""
    if belief is None or belief.is_full:
        return inputs.shapes
    named = zip(inputs.shapes.items(), belief.model, strict=True)
    return {name: (shape, albedo * factor) for (name, (shape, albedo)), factor in named}

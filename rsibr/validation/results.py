"""What a validation found: fill a `Validation`, and the report writes itself.

>>> from rsibr.validation.results import MethodResult, Validation, ViewResult
>>> view = ViewResult(frame, reference, {"cabral1999": MethodResult(image, error, seconds)})   # doctest: +SKIP
>>> write_report(Validation(bake, [view], exposures), directory)                                # doctest: +SKIP
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rsibr.planning.plan import Plan
from rsibr.validation.estimate import Estimate, mean_estimate
from rsibr.validation.eval_error import EvalError
from rsibr.validation.flip import Exposures
from rsibr.validation.health.health import Health
from rsibr.validation.lobes import LobeSummary, ViewLobes, summarise
from rsibr.validation.metrics import MapError, noise_floor
from rsibr.validation.reference import Reference


@dataclass(frozen=True)
class BakeSummary:
    """What was baked, and what it cost.

    Attributes
    ----------
    name, material, environment : str
        As a person calls them.
    views, resolution, samples : int
        Stored views, texels a side, samples a texel.
    seconds : float
        Wall time of the whole bake, set-up included.
    bytes : int
        Size on disk.
    details : dict
        More to show and to keep: versions, variant, configuration hash. Plain JSON values.
    """

    name: str
    material: str
    environment: str
    views: int
    resolution: int
    samples: int
    seconds: float
    bytes: int
    details: dict[str, str | int | float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class MethodResult:
    """One method at one view.

    Attributes
    ----------
    image : ndarray, shape (H, W, 3)
        Its map.
    error : MapError
        From `rsibr.validation.metrics.compare`.
    seconds : float
        Time of the whole map, device finished, nothing compiled.
    eval : EvalError or None
        Error and time of the method's `eval` at single points; None where it was not judged.
    """

    image: NDArray[np.float32]
    error: MapError
    seconds: float
    eval: EvalError | None = None

    def __repr__(self) -> str:
        return f"MethodResult(relMSE {self.error.rel_mse}, {1e3 * self.seconds:.3g} ms)"


@dataclass(frozen=True)
class MethodStart:
    """What a method takes before its first map.

    Attributes
    ----------
    prepare_seconds : float
        To make it ready, see `rsibr.methods.protocol.Cost`.
    compile_seconds : float
        What the first map took longer than the others.
    """

    prepare_seconds: float = 0.0
    compile_seconds: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class ViewResult:
    """All methods at one view.

    Attributes
    ----------
    frame : ndarray, shape (3, 3)
        Columns x, y and z = v.
    reference : Reference
    methods : dict of str to MethodResult
        In the order in which to show them.
    label : str
        Why this view: `"triangle centroid"`, `"random"`, …; may be empty.
    lobes : ViewLobes or None
        The same lobe by lobe; None where nobody looked.
    """

    frame: NDArray[np.float64]
    reference: Reference
    methods: dict[str, MethodResult]
    label: str = ""
    lobes: ViewLobes | None = None

    def __repr__(self) -> str:
        x, y, z = self.view
        return f"ViewResult(({x:.3g}, {y:.3g}, {z:.3g}): {', '.join(self.methods)})"

    @property
    def view(self) -> tuple[float, float, float]:
        """Direction from the surface to the viewer."""
        x, y, z = (float(component) for component in self.frame[:, 2])
        return x, y, z

    @cached_property
    def noise_floor(self) -> float:
        """Expected relMSE of a perfect map: the noise of the reference."""
        return noise_floor(self.reference)


@dataclass(frozen=True)
class MethodSummary:
    """One method over all views.

    Attributes
    ----------
    rel_mse : Estimate
        Mean over the views; the interval holds the reference's noise.
    rel_mse_range : tuple of two floats
        Smallest and largest of the views.
    rel_mse_zones : dict of str to Estimate
        Mean over the views of each zone of radius.
    smape, flip : float
        Means over the views.
    energy_ratio : float or None
        Mean over the views; None where one has none.
    worst_texel : float
        Largest relative squared error of any texel of any view.
    seconds : float
        Mean time of a map.
    seconds_range : tuple of two floats
        Shortest and longest.
    eval_rel_mse : Estimate or None
        RelMSE of `eval`, mean over the views; None where it was not judged.
    eval_seconds : float or None
        Mean time of one evaluation of `eval`.
    prepare_seconds : float
        Time to make the method ready, see `Cost`.
    compile_seconds : float
        Time that the first map took longer than the others: tracing and compilation.
    path_tracing_seconds : float
        Time in which the reference's path tracer reaches the same relMSE on one map; a lower bound where the error is
        below the noise floor.
    break_even_views : int or None
        Maps after which baking, preparing, compiling and reconstructing has cost no more than path tracing each; None
        if it never has.
    """

    rel_mse: Estimate
    rel_mse_range: tuple[float, float]
    rel_mse_zones: dict[str, Estimate]
    smape: float
    flip: float
    energy_ratio: float | None
    worst_texel: float
    seconds: float
    seconds_range: tuple[float, float]
    eval_rel_mse: Estimate | None
    eval_seconds: float | None
    prepare_seconds: float
    compile_seconds: float
    path_tracing_seconds: float
    break_even_views: int | None


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """A bake held against the truth at some views.

    Attributes
    ----------
    bake : BakeSummary
    views : list of ViewResult
        At least one; the same methods in each.
    exposures : Exposures
        Those of FLIP, for all views.
    health : Health or None
        Numerical health of the bake itself; None where nobody looked.
    plan : Plan or None
        Which effects the bake simulated; None in a bake without a plan.
    starts : dict of str to MethodStart
        What each method took before its first map; none where nobody measured.
    """

    bake: BakeSummary
    views: list[ViewResult]
    exposures: Exposures
    health: Health | None = None
    plan: Plan | None = None
    starts: dict[str, MethodStart] = field(default_factory=dict)

    def __repr__(self) -> str:
        errors = ", ".join(f"{name} {one.rel_mse.value:.3g}" for name, one in self.summary.items())
        return f"Validation({self.bake.name!r} at {len(self.views)} views; relMSE: {errors})"

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order in which to show them."""
        return list(self.views[0].methods)

    @cached_property
    def summary(self) -> dict[str, MethodSummary]:
        """Each method over all views."""
        return {name: self._summarise(name) for name in self.methods}

    @property
    def lobes(self) -> list[ViewLobes]:
        """The lobes at each view; none where nobody looked."""
        return [view.lobes for view in self.views if view.lobes is not None]

    @cached_property
    def lobe_summary(self) -> dict[str, LobeSummary]:
        """Each lobe over all views; none where nobody looked."""
        return summarise(self.lobes) if self.lobes else {}

    def _summarise(self, name: str) -> MethodSummary:
        results = [view.methods[name] for view in self.views]
        errors = [result.error for result in results]
        seconds = [result.seconds for result in results]
        rel_mse = mean_estimate([error.rel_mse for error in errors])
        values = [error.rel_mse.value for error in errors]
        energy = [error.energy_ratio for error in errors if error.energy_ratio is not None]
        path_tracing = self._path_tracing_seconds(rel_mse)
        start = self.starts.get(name, MethodStart())
        once = self.bake.seconds + start.prepare_seconds + start.compile_seconds
        points = [result.eval for result in results if result.eval is not None]
        return MethodSummary(
            rel_mse=rel_mse,
            rel_mse_range=(min(values), max(values)),
            rel_mse_zones={
                zone: mean_estimate([error.rel_mse_zones[zone] for error in errors if zone in error.rel_mse_zones])
                for zone in errors[0].rel_mse_zones
            },
            smape=float(np.mean([error.smape for error in errors])),
            flip=float(np.mean([error.flip for error in errors])),
            energy_ratio=float(np.mean(energy)) if len(energy) == len(errors) else None,
            worst_texel=max(error.worst_texel.error for error in errors),
            seconds=float(np.mean(seconds)),
            seconds_range=(min(seconds), max(seconds)),
            eval_rel_mse=mean_estimate([point.rel_mse for point in points]) if points else None,
            eval_seconds=float(np.mean([point.seconds for point in points])) if points else None,
            prepare_seconds=start.prepare_seconds,
            compile_seconds=start.compile_seconds,
            path_tracing_seconds=path_tracing,
            break_even_views=break_even_views(once, path_tracing, float(np.mean(seconds))),
        )

    def _path_tracing_seconds(self, error: Estimate) -> float:
        """Time of the reference's path tracer to the same relMSE: it falls with 1/samples from the noise floor."""
        floor = float(np.mean([view.noise_floor for view in self.views]))
        samples = float(np.mean([view.reference.samples for view in self.views]))
        seconds = float(np.mean([view.reference.seconds for view in self.views]))
        reached = error.ci95[1] if error.below_noise_floor else error.value
        share = floor / reached if reached > 0 else 0.0
        return seconds * max(share, 1.0 / samples)  # one sample a texel is the least that can be had


def break_even_views(once_seconds: float, path_tracing_seconds: float, reconstruct_seconds: float) -> int | None:
    """Count the views after which a bake has cost no more than path tracing each view to the same error.

    Parameters
    ----------
    once_seconds : float
        Spent once: the bake, and what the method takes before its first map.
    path_tracing_seconds, reconstruct_seconds : float
        Spent on each view, without and with the bake.

    Returns
    -------
    int or None
        None where a reconstructed view takes as long as a path-traced one, or longer: it never pays.
    """
    saved = path_tracing_seconds - reconstruct_seconds
    return math.ceil(once_seconds / saved) if saved > 0 else None

"""Results of a validation, from which the report is written.

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

from rsibr.late import late
from rsibr.planning.plan import Plan
from rsibr.store.csv_table import csv_table
from rsibr.store.tabular import Tabular
from rsibr.validation.equal_error import path_tracing_seconds
from rsibr.validation.estimate import Estimate, mean_estimate
from rsibr.validation.eval_error import EvalError
from rsibr.validation.flip import Exposures
from rsibr.validation.health.health import Health
from rsibr.validation.lobes import LobeSummary, ViewLobes, summarise
from rsibr.validation.metrics import MapError, noise_floor
from rsibr.validation.reference import Reference


@dataclass(frozen=True)
class BakeSummary:
    """Contents and cost of a bake.

    Attributes
    ----------
    name, material, environment : str
        Names of the bake, the material and the environment.
    views, resolution, samples : int
        Stored views, texels a side, samples a texel.
    seconds : float
        Wall time of the whole bake, set-up included.
    bytes : int
        Size on disk.
    details : dict
        Further JSON values: versions, variant, configuration hash.
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
        Reconstructed map.
    error : MapError
        Metrics from `rsibr.validation.metrics.compare`.
    seconds : float
        Time of the whole map until the device has finished, without compilation [s].
    eval : EvalError or None
        Error and time of the method's `eval` at single points; None if it was not measured.
    """

    image: NDArray[np.float32]
    error: MapError
    seconds: float
    eval: EvalError | None = None

    def __repr__(self) -> str:
        return f"MethodResult(relMSE {self.error.rel_mse}, {1e3 * self.seconds:.3g} ms)"

    @property
    def row(self) -> dict[str, float | str]:
        """Its cells in the table of errors; an empty one where a value does not exist."""
        error, worst = self.error, self.error.worst_texel
        low, high = error.rel_mse.ci95
        return {
            "rel_mse": error.rel_mse.value,
            "rel_mse_low": low,
            "rel_mse_high": high,
            "smape": error.smape,
            "flip": error.flip,
            "energy_ratio": "" if error.energy_ratio is None else error.energy_ratio,
            "worst_texel": worst.error,
            "worst_s": worst.s,
            "worst_t": worst.t,
            "seconds": self.seconds,
        }


@dataclass(frozen=True)
class MethodStart:
    """Cost of a method before its first map.

    Attributes
    ----------
    prepare_seconds : float
        Preparation time [s], see `rsibr.methods.protocol.Cost`.
    compile_seconds : float
        Extra time of the first map: tracing and compilation [s].
    bake_seconds, bytes : float, int
        Time of the bake [s] and size on disk [bytes] behind what the method reads, see `Cost`.
    """

    prepare_seconds: float = 0.0
    compile_seconds: float = 0.0
    bake_seconds: float = 0.0
    bytes: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class ViewResult:
    """All methods at one view.

    Attributes
    ----------
    frame : ndarray, shape (3, 3)
        Columns x, y and z = v.
    reference : Reference
        Path-traced map of the view.
    methods : dict of str to MethodResult
        Result by name of the method, in display order.
    label : str
        Origin of the view: `"triangle centroid"`, `"random"`, …; may be empty.
    lobes : ViewLobes or None
        Errors of single lobes; None if they were not measured.
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

    @property
    def row(self) -> dict[str, float | str]:
        """Its cells in the table of errors."""
        return {**dict(zip(("view_x", "view_y", "view_z"), self.view, strict=True)), "origin": self.label}

    @cached_property
    def noise_floor(self) -> float:
        """Expected relMSE of a perfect map, due to the noise of the reference."""
        return noise_floor(self.reference)


@dataclass(frozen=True)
class MethodSummary:
    """One method over all views.

    Attributes
    ----------
    rel_mse : Estimate
        Mean over the views; the interval is that due to the noise of the reference.
    rel_mse_range : tuple of two floats
        Minimum and maximum over the views.
    rel_mse_zones : dict of str to Estimate
        Mean over the views for each zone of radius.
    smape, flip : float
        Means over the views.
    energy_ratio : float or None
        Mean over the views; None if it is undefined at one of them.
    worst_texel : float
        Maximum relative squared error over all texels of all views.
    seconds : float
        Mean time of a map [s].
    seconds_range : tuple of two floats
        Minimum and maximum time of a map [s].
    eval_rel_mse : Estimate or None
        RelMSE of `eval`, mean over the views; None if it was not measured.
    eval_seconds : float or None
        Mean time of one evaluation of `eval` [s].
    prepare_seconds : float
        Preparation time of the method [s], see `Cost`.
    compile_seconds : float
        Extra time of the first map: tracing and compilation [s].
    bake_seconds, bytes : float, int
        See `MethodStart`.
    path_tracing_seconds : float
        Time of the reference's path tracer to the same relMSE on one map [s]; a lower bound if the error is below the
        noise floor.
    break_even_views : int or None
        Number of maps from which bake, preparation, compilation and reconstruction together take no more time than
        path tracing; None if they always take more.
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
    bake_seconds: float
    bytes: int
    path_tracing_seconds: float
    break_even_views: int | None


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Tabular):
    """Comparison of a bake with path-traced references at novel views.

    Attributes
    ----------
    bake : BakeSummary
        Contents and cost of the bake.
    views : list of ViewResult
        At least one; the same methods in each.
    exposures : Exposures
        Exposures of FLIP, the same for all views.
    health : Health or None
        Numerical health of the bake; None if it was not assessed.
    plan : Plan or None
        Effects that the bake simulated; None in a bake without a plan.
    starts : dict of str to MethodStart
        Cost of each method before its first map; empty if it was not measured: the whole bake counts then.
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

    show = late("rsibr.publishing.notebooks.plots:show_validation", "Figure of one view by all methods.")
    plot = late("rsibr.publishing.notebooks.plots:plot_validation", "Figure of each method's error over its time.")
    _repr_html_ = late("rsibr.publishing.notebooks.cards:validation_card", "Card for a notebook.")

    def csv(self) -> str:
        """Text of the table of errors: a row for each view and method."""
        rows = [
            {**view.row, "method": name, **result.row} for view in self.views for name, result in view.methods.items()
        ]
        return csv_table(list(rows[0]), rows)

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in display order."""
        return list(self.views[0].methods)

    @cached_property
    def summary(self) -> dict[str, MethodSummary]:
        """Summary of each method over all views."""
        return {name: self._summarise(name) for name in self.methods}

    @property
    def lobes(self) -> list[ViewLobes]:
        """Errors of single lobes at each view; empty if they were not measured."""
        return [view.lobes for view in self.views if view.lobes is not None]

    @cached_property
    def lobe_summary(self) -> dict[str, LobeSummary]:
        """Summary of each lobe over all views; empty if lobes were not measured."""
        return summarise(self.lobes) if self.lobes else {}

    def _summarise(self, name: str) -> MethodSummary:
        results = [view.methods[name] for view in self.views]
        errors = [result.error for result in results]
        seconds = [result.seconds for result in results]
        rel_mse = mean_estimate([error.rel_mse for error in errors])
        values = [error.rel_mse.value for error in errors]
        energy = [error.energy_ratio for error in errors if error.energy_ratio is not None]
        path_tracing = self._path_tracing_seconds(rel_mse)
        start = self.starts.get(name) or MethodStart(bake_seconds=self.bake.seconds, bytes=self.bake.bytes)
        once = start.bake_seconds + start.prepare_seconds + start.compile_seconds
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
            bake_seconds=start.bake_seconds,
            bytes=start.bytes,
            path_tracing_seconds=path_tracing,
            break_even_views=break_even_views(once, path_tracing, float(np.mean(seconds))),
        )

    def _path_tracing_seconds(self, error: Estimate) -> float:
        """See `path_tracing_seconds`; means over the views."""
        floor = float(np.mean([view.noise_floor for view in self.views]))
        samples = float(np.mean([view.reference.samples for view in self.views]))
        seconds = float(np.mean([view.reference.seconds for view in self.views]))
        return path_tracing_seconds(error, floor, samples, seconds)


def break_even_views(once_seconds: float, path_tracing_seconds: float, reconstruct_seconds: float) -> int | None:
    """Number of views from which a bake takes no more time than path tracing each view to the same error.

    Parameters
    ----------
    once_seconds : float
        Time spent once: bake, preparation, compilation [s].
    path_tracing_seconds, reconstruct_seconds : float
        Time of each view without and with the bake [s].

    Returns
    -------
    int or None
        None if a reconstructed view takes at least as long as a path-traced one.
    """
    saved = path_tracing_seconds - reconstruct_seconds
    return math.ceil(once_seconds / saved) if saved > 0 else None

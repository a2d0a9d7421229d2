"""Validation of a bake against path-traced references: error and time of every method at novel views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.baking.baked_scene import require_rendered, require_unchanged
from rsibr.baking.scene import Scene
from rsibr.errors import CheckFailed, InputError
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.geometry.novel_views import novel_views as drawn_views
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.job_size import JobSize
from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import Cost, Method
from rsibr.methods.reconstruction import Reconstruction, run
from rsibr.methods.registry import available, method_names, registration
from rsibr.progress import Job
from rsibr.scene.environment import Environment
from rsibr.shown_progress import shows_progress
from rsibr.store.bake import Bake, open_bake
from rsibr.store.map_file import MapFile
from rsibr.validation.eval_error import judge_eval
from rsibr.validation.flip import exposures_for
from rsibr.validation.health.health import Health, assess
from rsibr.validation.health.health_report import write_health
from rsibr.validation.job import validation_job
from rsibr.validation.lobes import LobeJudge, has_lobes
from rsibr.validation.metrics import compare
from rsibr.validation.reference import MINIMUM_BUFFERS, ReferenceRenderer
from rsibr.validation.report.report import write_report
from rsibr.validation.results import BakeSummary, MethodResult, MethodStart, Validation, ViewResult

DEFAULT_VIEWS = 8
DEFAULT_SAMPLES = 1024
LOBE_SAMPLES = 4
"""Samples of a path-traced reference over those of a lobe-resolved one, which is less noisy at equal samples."""

TIMED_RUNS = 5
"""Timed runs of each reconstruction after the first, which compiles; the median is reported."""

_VIEW_BRANCH = 0x76696577
"""Branch of the seed tree (the letters "view") for novel views."""


@shows_progress(Job("validate"))
@backend.in_session
def validate(
    bake: Bake | Path | str,
    *,
    views: int | Sequence[ArrayLike] = DEFAULT_VIEWS,
    methods: Sequence[str] | None = None,
    samples: int = DEFAULT_SAMPLES,
    buffers: int = MINIMUM_BUFFERS,
    lobes: bool | None = None,
    out: Path | str | None = None,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
    scene: Scene | None = None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
) -> Validation:
    """Compare methods with path-traced references at views that were not baked.

    Parameters
    ----------
    bake : Bake or path
        A finished bake. The environment and material files that it was made from must exist, unchanged.
    views : int or sequence of array_like
        View directions, or their number: half at triangle centroids, the points farthest from any stored view, and
        half random, from the bake's seed.
    methods : sequence of str, optional
        Names of methods, see `rsibr.method_names`; by default all whose requirements the bake meets.
    samples : int
        Samples a texel of each reference, total of all buffers.
    buffers : int
        Independent buffers of a reference, at least 8.
    lobes : bool, optional
        Whether to measure the errors of single lobes of `rsibr` too, see `rsibr.validation.lobes`; by default if
        `rsibr` is among the methods and the bake has more than one lobe.
    out : path, optional
        Directory for `report.html`, `metrics.json` and the images.
    on_progress : callable
        Called with the number of views done and the total.
    scene : Scene, optional
        Scene of the bake if it is prepared already; by default it is loaded.
    on_forecast : callable
        Called once with memory and time before the work begins.
    allow_large : bool
        Start even if the validation exceeds the free memory.

    Returns
    -------
    Validation
        Error with its confidence interval, and time, of each method at each view.

    Raises
    ------
    InputError
        If a view or a method is invalid, an input file is missing, the memory is too small (unless `allow_large`), or
        `lobes` is set for a bake with a single lobe.
    BakeError
        If the bake cannot be read, or its inputs have changed since.
    CheckFailed
        If a stored map has NaN, Inf or missing texels. Raised before anything is rendered; the findings are written to
        `out`.

    Examples
    --------
    >>> report = rsibr.validate("out/paint.rsibr", views=8, out="out/report")    # doctest: +SKIP
    >>> print(report.summary["rsibr"].rel_mse)                                   # doctest: +SKIP
    """
    on_progress, on_forecast = backend.unlocked(on_progress), backend.unlocked(on_forecast)
    opened = bake if isinstance(bake, Bake) else open_bake(Path(bake))
    require_rendered(opened)
    wanted = available(opened) if methods is None else methods
    names = [registration(name).name for name in dict.fromkeys(wanted)]
    if not names:
        raise InputError("no method given", where="method", fix=f"there are: {', '.join(method_names())}")
    chosen = _chosen_views(opened, views)
    by_lobe = has_lobes(opened, names, lobes)
    job = validation_job(opened, len(chosen), len(names), samples)
    job.admit(None, allow_large)
    on_forecast(job)
    load = cache(lambda: scene or Scene.prepare(opened.config))
    method_set = MethodSet(opened)
    maps = method_set.inputs.maps  # decoded once, shared by health check, exposure and methods
    health = _trusted_health(opened, [view for _, view in chosen], out, lambda: load().environment, maps)
    prepared = require_unchanged(opened, load())
    renderer = ReferenceRenderer(prepared.environment, prepared.material, opened.resolution, opened.rendering)
    of_lobes = max(samples // LOBE_SAMPLES, buffers)
    judge = LobeJudge(opened, prepared, method_set, of_lobes, buffers) if by_lobe else None
    exposures = exposures_for(_mean_radiance(maps))
    results, starts = [], dict[str, float]()
    for done, (label, view) in enumerate(chosen):
        on_progress(done, len(chosen))
        frame = view_frame(view)
        reference = renderer.render(frame, samples, seed=_seed(opened), buffers=buffers)
        found = {}
        for name in names:
            made, first = timed(method_set[name], frame, opened.resolution)
            starts.setdefault(name, max(0.0, first - made.seconds))
            error = compare(made.image, reference, exposures, name=f"{name} at view {done}")
            points = judge_eval(method_set[name], frame, reference, _seed(opened))
            found[name] = MethodResult(made.image, error, made.seconds, points)
        results.append(ViewResult(frame, reference, found, label, judge.at(frame) if judge else None))
    on_progress(len(chosen), len(chosen))
    before = {name: _start(method_set[name].cost, compiled) for name, compiled in starts.items()}
    validation = Validation(bake_summary(opened), results, exposures, health, opened.manifest.plan, before)
    if out is not None:
        write_report(validation, Path(out))
    return validation


def novel_views(bake: Bake, count: int) -> list[tuple[str, NDArray[np.float64]]]:
    """Draw the novel views of a validation, the same for the same bake and count.

    Parameters
    ----------
    bake : Bake
        Determines the views by its triangles and its seed.
    count : int
        Number of views, at least 1: the first half, rounded up, at triangle centroids.

    Returns
    -------
    list of (str, ndarray of shape (3,))
        Origin of each view (see `rsibr.geometry.novel_views`), and its unit direction.
    """
    seeds = np.random.SeedSequence(_seed(bake), spawn_key=(_VIEW_BRANCH,))
    return drawn_views(Viewpoints(bake.directions, bake.triangles), count, seeds)


def timed(method: Method, frame: NDArray[np.float64], resolution: int) -> tuple[Reconstruction, float]:
    """Reconstruct and time a map in several runs.

    Returns
    -------
    made : Reconstruction
        Map, with the median time of `TIMED_RUNS` runs.
    first : float
        Time of an earlier first run, which may trace and compile kernels [s].
    """
    made = run(method, frame, resolution)
    return replace(
        made, seconds=median(run(method, frame, resolution).seconds for _ in range(TIMED_RUNS))
    ), made.seconds


def _chosen_views(bake: Bake, views: int | Sequence[ArrayLike]) -> list[tuple[str, NDArray[np.float64]]]:
    if not isinstance(views, int):
        given = [("given", unit_view(view)) for view in views]
        if not given:
            raise InputError("no view given", where="view", fix="give at least one X,Y,Z")
        return given
    if views < 1:
        raise InputError(f"{views} views", where="views", fix="give at least 1")
    return novel_views(bake, views)


def _trusted_health(
    bake: Bake,
    views: list[NDArray[np.float64]],
    out: Path | str | None,
    environment: Callable[[], Environment],
    maps: Sequence[MapFile],
) -> Health:
    """Assess the bake before references are rendered; raise if a stored map has NaN or holes."""
    health = assess(bake, views, environment, maps)
    if health.trusted:
        return health
    if out is not None:
        write_health(health, Path(out))
    found = "; ".join(
        str(finding) for finding in health.findings.values() if finding.verdict == "failed" and finding.texels
    )
    raise CheckFailed(f"cannot be validated: {found}", where=str(bake.path), fix=f"see `rsibr check {bake.path}`")


def _mean_radiance(maps: Sequence[MapFile]) -> float:
    """Mean radiance over the stored maps, for one exposure of all views and methods."""
    total = sum(float((m.radiance * m.coverage[..., None]).sum()) for m in maps)
    return total / (3 * sum(float(m.coverage.sum()) for m in maps))


def _seed(bake: Bake) -> int:
    return 0 if bake.manifest.capture is not None else int(bake.config["sampling"]["seed"])


def _start(cost: Cost, compile_seconds: float) -> MethodStart:
    return MethodStart(cost.prepare_seconds, compile_seconds, cost.bake_seconds, cost.bytes)


def bake_summary(bake: Bake) -> BakeSummary:
    """Contents and cost of a bake, for a report."""
    manifest = bake.manifest
    return BakeSummary(
        name=bake.path.stem,
        material=manifest.material.name,
        environment=manifest.environment.name,
        views=bake.view_count,
        resolution=bake.resolution,
        samples=manifest.samples,
        seconds=bake.seconds,
        bytes=bake.bytes,
        details={
            "variant": manifest.variant,
            "warp": manifest.material.warp,
            "config_hash": manifest.config_hash,
            "clipped_values": manifest.environment.clipped,
            **({"notes": "; ".join(manifest.material.notes)} if manifest.material.notes else {}),
            **{f"version_{name}": version for name, version in manifest.packages.items()},
        },
    )

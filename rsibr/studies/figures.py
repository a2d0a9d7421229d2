"""Figures of a study as SVG for the page: error against time, Pareto fronts, composition of the error."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, LogLocator

from rsibr.methods.registry import baseline_method, default_method, method_names
from rsibr.studies.analysis import COSTS, ConvergenceRecord, SceneAnalysis
from rsibr.studies.convergence import PowerLaw
from rsibr.studies.document import StudyDocument
from rsibr.studies.doubling import PATH_TRACING, DoublingRecord
from rsibr.studies.results import PathTracingRecord, PointRecord, SceneRecord

_PATH_TRACING, _DEFAULT, _BASELINE = "#222222", "#d55e00", "#0072b2"
_METHODS = ("#999999", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#f0e442")
_OTHERS = _METHODS[2:]
"""Okabe & Ito (2008): distinguishable with colour vision deficiency."""

_MARKERS = "osD^vP*X"
_FLOOR = "#e8e8e8"
_ONE_VALUE = 1 + 1e-6
"""Ratio of the largest value to the least below which they differ by rounding: Matplotlib's limits would coincide."""

_COST_LABELS = {
    "once_seconds": ("before the first", "s"),
    "bytes": ("on the device", "B"),
    "frame_seconds": ("a picture", "s"),
}

_STYLE: Any = {  # Matplotlib types its keys one by one
    "svg.fonttype": "none",
    "svg.hashsalt": "rsibr",
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#eeeeee",
    "axes.axisbelow": True,
    "legend.frameon": False,
}


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Draw a figure in the common style, whatever Matplotlib style is set."""

    def drawn(*arguments: Any, **options: Any) -> Figure:
        with mpl.rc_context(_STYLE):
            return draw(*arguments, **options)

    drawn.__doc__, drawn.__name__ = draw.__doc__, draw.__name__
    return drawn


def svg_uri(figure: Figure) -> str:
    """Encode a figure as a data URI for an HTML page; equal figures give equal bytes."""
    stream = io.BytesIO()
    with mpl.rc_context(_STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None}, facecolor="white")
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def colour_of(method: str) -> str:
    """Colour of a method, the same in every figure."""
    fixed = {PATH_TRACING: _PATH_TRACING, default_method(): _DEFAULT, baseline_method(): _BASELINE}
    if method in fixed:
        return fixed[method]
    others = [name for name in method_names() if name not in fixed]
    number = others.index(method) if method in others else sum(method.encode())
    return _METHODS[number % len(_METHODS)]


@styled
def headline(document: StudyDocument) -> Figure:
    """Least error over the time of the whole job, and the gain of twice the time."""
    figure = Figure(figsize=(11, 4.3), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    for record in document.doubling:
        colour = colour_of(record.method)
        left.plot(record.seconds, record.rel_mse, "-o", color=colour, markersize=4.5, label=record.method)
        rows = zip(record.seconds, record.gain, record.gain_ci95, strict=True)
        known = np.array([(t, gain, *ci) for t, gain, ci in rows if gain is not None and ci is not None])
        if len(known):
            t, gain, low, high = known.T
            bars, options = [gain - low, high - gain], {"markersize": 4.5, "capsize": 2, "label": record.method}
            right.errorbar(t, gain, yerr=bars, fmt="-o", color=colour, **options)
    _name_ends(left, document.doubling)
    _floor(left, min(scene.reference.noise_floor for scene in document.scenes))
    logarithmic(left)
    left.set(ylabel="relMSE, mean over the scenes")
    logarithmic(right, "x")
    right.set(ylabel="twice the time divides the error by")
    right.axhline(1, color="#888888", linewidth=0.8)
    right.text(
        0.99, 1.01, "buys nothing", transform=right.get_yaxis_transform(), ha="right", fontsize=8, color="#666666"
    )
    right.set_ylim(bottom=0.9)
    for axes in (left, right):
        axes.set_xlabel(f"time of the whole job, {document.judge.frames} pictures")
        count_in(axes, "s")
    if document.doubling:
        left.legend(loc="best")
    return figure


@styled
def convergence(scene: SceneRecord, analysis: SceneAnalysis) -> Figure:
    """Error against rendering time with fitted lines, noise floor, and a mark where noise equals bias."""
    figure = Figure(figsize=(11, 5), layout="constrained")
    axes = figure.subplots()
    _floor(axes, scene.reference.noise_floor)
    _rival(axes, scene.path_tracing, analysis.path_tracing.law, "path tracing, a picture", "#222222")
    each = scene.progressive[0].pass_samples
    _rival(axes, scene.progressive, analysis.progressive.law, f"the same in passes of {each}", "#8a8a8a")
    by_label = {point.label: point for point in scene.points}
    curved = {label for curve in analysis.convergence for label in curve.points}
    for number, curve in enumerate(analysis.convergence):
        _curve(axes, curve, [by_label[label] for label in curve.points], _MARKERS[number % len(_MARKERS)])
    alone = [point for point in scene.points if point.label not in curved and point.rel_mse > 0]
    for point in alone:
        axes.plot(point.bake.views_seconds.median, point.rel_mse, ".", color=colour_of(point.method), alpha=0.4)
    logarithmic(axes)
    axes.set(ylabel="relMSE", xlabel="rendering time: of the views of a bake, or of one path-traced picture")
    count_in(axes, "s")
    if axes.get_legend_handles_labels()[0]:  # a black scene has nothing to name
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8.5)
    return figure


@styled
def fronts(scene: SceneRecord, analysis: SceneAnalysis) -> Figure:
    """Error over each cost: the front as a line, dominated points hollow."""
    figure = Figure(figsize=(11, 3.8), layout="constrained")
    for axes, (name, cost) in zip(figure.subplots(1, len(COSTS), sharey=True), COSTS.items(), strict=True):
        on, (label, unit) = analysis.fronts[name].on, _COST_LABELS[name]
        line = [point for label in on for point in scene.points if point.label == label and point.rel_mse > 0]
        axes.step([cost(p) for p in line], [p.rel_mse for p in line], where="post", color="#bbbbbb", linewidth=1.2)
        for method in dict.fromkeys(point.method for point in scene.points):
            for front in (True, False):
                shown = [p for p in scene.points if p.method == method and (p.label in on) is front and p.rel_mse > 0]
                face = colour_of(method) if front else "none"
                points = [cost(p) for p in shown], [p.rel_mse for p in shown]
                axes.scatter(
                    *points, s=26, facecolors=face, edgecolors=colour_of(method), label=method if front else None
                )
        logarithmic(axes)
        axes.set(xlabel=label)
        count_in(axes, unit)
    figure.axes[0].set_ylabel("relMSE")
    figure.axes[-1].legend(loc="best", fontsize=8)
    return figure


@styled
def whereabouts(points: Sequence[PointRecord]) -> Figure:
    """Composition of the error of some points: bias and noise, zones of radius, lobes."""
    figure = Figure(figsize=(11, 0.9 + 0.42 * len(points)), layout="constrained")
    share, zones = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(points))[::-1]
    noise = np.array([100 * _noise_share(point) for point in points])
    share.barh(rows, 100 - noise, color="#b8c4d0", height=0.6, label="bias")
    share.barh(rows, noise, left=100 - noise, color="#e8c39e", height=0.6, label="noise of the maps")
    share.set(xlabel="share of relMSE, %", yticks=rows, yticklabels=[point.label for point in points], xlim=(0, 100))
    share.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8)
    share.grid(visible=False)
    for zone, marker in (("inner", "o"), ("middle", "D"), ("rim", "s")):
        _dots(zones, rows, [_zone(point, zone) for point in points], marker, "#444444", zone)
    for number, lobe in enumerate(dict.fromkeys(name for point in points for name in point.lobes or ())):
        values = [point.lobes[lobe].value if point.lobes and lobe in point.lobes else None for point in points]
        _dots(zones, rows - 0.2, values, "|", _OTHERS[number % len(_OTHERS)], f"lobe {lobe}")
    logarithmic(zones, "x")
    zones.set(xlabel="relMSE of the zone, or that the lobe makes")
    if any(point.rel_mse > 0 for point in points):
        zones.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    return figure


def _noise_share(point: PointRecord) -> float:
    return min((point.noise or 0.0) / point.rel_mse, 1.0) if point.rel_mse > 0 else 1.0


def _zone(point: PointRecord, zone: str) -> float | None:
    estimate = point.error.rel_mse_zones.get(zone)
    return None if estimate is None else estimate.value


def _dots(axes: Axes, rows: Any, values: Iterable[float | None], marker: str, colour: str, label: str) -> None:
    known = [(value, row) for value, row in zip(values, rows, strict=True) if value is not None and value > 0]
    if known:
        options = {"s": 34, "linewidths": 2.2} if marker == "|" else {"s": 22, "facecolors": "none"}
        axes.scatter(*zip(*known, strict=True), marker=marker, color=colour, label=label, **options)


def _rival(axes: Axes, rivals: Sequence[PathTracingRecord], law: PowerLaw, name: str, colour: str) -> None:
    _with_bars(axes, [r.seconds.median for r in rivals], [r.error.rel_mse for r in rivals], colour, "s")
    if not any(r.error.rel_mse.value > 0 for r in rivals):
        return  # a black scene: its law is that of placeholders
    label = f"{name}, slope {law.slope:.2f}".replace("-", "−") if law.is_measured else name
    axes.plot(law.range, [law.at(x) for x in law.range], color=colour, linewidth=1, label=label)


def _curve(axes: Axes, curve: ConvergenceRecord, points: Sequence[PointRecord], marker: str) -> None:
    """Points of a curve, the fit bias + noise/samples, and a mark where the two are equal."""
    colour = colour_of(points[0].method)
    seconds = np.array([point.bake.views_seconds.median for point in points])
    _with_bars(axes, seconds.tolist(), [point.error.rel_mse for point in points], colour, marker)
    samples = np.geomspace(points[0].bake.samples, points[-1].bake.samples, 64)
    rising = np.maximum.accumulate(seconds)  # timing noise may make the times non-monotonic
    times = np.interp(samples, [point.bake.samples for point in points], rising)
    told = curve.slope is not None and curve.slope.is_measured
    slope = f", slope {curve.slope.slope:.2f}".replace("-", "−") if told and curve.slope else ""
    axes.plot(times, curve.bias + curve.noise / samples, color=colour, linewidth=1, label=f"{curve.label}{slope}")
    if curve.bias > 0:
        axes.plot([rising[0], rising[-1]], [curve.bias] * 2, ":", color=colour, linewidth=1)
        if curve.flattens_at_seconds is not None:
            axes.plot(curve.flattens_at_seconds, 2 * curve.bias, "x", color=colour, markersize=10, markeredgewidth=2)


def _with_bars(axes: Axes, x: Sequence[float], estimates: Sequence[Any], colour: str, marker: str) -> None:
    """Points with 95 % confidence intervals; an interval that reaches zero runs off the axis."""
    shown = [(t, e) for t, e in zip(x, estimates, strict=True) if e.value > 0]
    values = np.array([e.value for _, e in shown])
    low = np.array([max(e.ci95[0], e.value * 1e-3) for _, e in shown])
    high = np.array([e.ci95[1] for _, e in shown])
    axes.errorbar(
        [t for t, _ in shown],
        values,
        yerr=[values - low, high - values],
        fmt=marker,
        color=colour,
        markersize=5,
        capsize=2,
    )


def logarithmic(axes: Axes, which: str = "xy") -> None:
    """Make axes logarithmic; axes without positive data, as of a black scene, or of one value get fixed limits."""
    for name, low, high in zip("xy", np.asarray(axes.dataLim.minpos), axes.dataLim.max, strict=True):
        if name in which:
            if not 0 < high < np.inf:
                axes.set(**{f"{name}lim": (0.1, 1)})
            elif high / low < _ONE_VALUE:
                axes.set(**{f"{name}lim": (high / 3, high * 3)})
            axes.set(**{f"{name}scale": "log"})


def count_in(axes: Axes, unit: str) -> None:
    """Label the ticks of a logarithmic axis with units: 20 ms, 1 MB."""
    for place in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
        place(EngFormatter(unit))
    axes.xaxis.set_minor_locator(LogLocator(subs=(2, 5)))
    axes.tick_params(axis="x", which="both", labelsize=8)


def _floor(axes: Axes, floor: float) -> None:
    """Band of errors below the noise floor of the reference; visible because that noise is subtracted."""
    if floor <= 0:
        return
    axes.axhspan(floor / 5, floor, color=_FLOOR, zorder=0)
    place = axes.get_yaxis_transform()
    axes.text(
        0.99, floor * 0.93, "noise of the reference", transform=place, ha="right", va="top", fontsize=8, color="#777777"
    )


def _name_ends(axes: Axes, records: Sequence[DoublingRecord]) -> None:
    """Label the last point of each method."""
    for record in records:
        place = (record.seconds[-1], record.rel_mse[-1])
        text = record.labels[-1].removeprefix(f"{record.method}, ")
        axes.annotate(
            text, place, xytext=(5, -3), textcoords="offset points", fontsize=7.5, color=colour_of(record.method)
        )

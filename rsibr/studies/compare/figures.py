"""Figures of a comparison as SVG: which system wins at which cost, and fronts of error over each cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from rsibr.methods.registry import baseline_method, default_method, method_names
from rsibr.studies.compare.budgets import COSTS, ClassRecord, MeanRecord, WinnerRecord, unit_of
from rsibr.studies.figures import colour_of, count_in, logarithmic, styled
from rsibr.validation.estimate import readable

_COLOURS = (
    "#a6a6a6",
    "#e69f00",
    "#cc79a7",
    "#009e73",
    "#56b4e9",
    "#f0e442",
    "#6a3d9a",
    "#8c510a",
    "#b2df8a",
    "#1b1b1b",
    "#fb9a99",
)
"""Beside those of the default and the baseline; the first ones by Okabe & Ito (2008)."""

_COST_LABELS = {
    "once_seconds": "time before the first map",
    "bytes": "memory on the device",
    "frame_seconds": "time of a map",
}

_LETTER = 0.022
"""Width of a letter in a band, as a share of the axis."""

_MOST_NAMES = 9
"""Names in a row of a legend."""

_DECADES = 1.3
"""Length of an axis in decades up to which ticks between powers of ten are labelled."""


def colours_of(systems: Sequence[str]) -> dict[str, str]:
    """Colour of each system, the same in every figure; a method has its own in all comparisons."""
    fixed = (default_method(), baseline_method())
    plain = [name for name in method_names() if name not in fixed]
    plain += [name for name in systems if name not in plain and name not in fixed]
    others = {name: _COLOURS[number % len(_COLOURS)] for number, name in enumerate(plain)}
    return {name: colour_of(name) if name in fixed else others[name] for name in systems}


@styled
def headline(classes: Sequence[ClassRecord], colours: Mapping[str, str]) -> Figure:
    """Band of the winning system over each cost, a row a class of material; numbers are relMSE."""
    figure = Figure(figsize=(11, 1.7 + 0.5 * len(classes)), layout="constrained")
    panels = figure.subplots(1, len(COSTS), sharey=True)
    for axes, cost in zip(panels, COSTS, strict=True):
        low, high = _range(classes, cost)
        axes.set(xscale="log", xlim=(low, high))
        for row, record in enumerate(reversed(classes)):
            _band(axes, row, record.winners[cost], colours)
        _label(axes, cost)
        axes.grid(visible=False)
    names = [f"{record.name} ({record.scenes})" for record in reversed(classes)]
    panels[0].set(yticks=np.arange(len(classes)), yticklabels=names, ylim=(-0.6, len(classes) - 0.4))
    winning = {one.system for record in classes for rows in record.winners.values() for one in rows}
    handles = [Patch(color=colour, label=name) for name, colour in colours.items() if name in winning]
    _legend(figure, handles)
    return figure


@styled
def fronts(record: ClassRecord, colours: Mapping[str, str]) -> Figure:
    """Error over each cost: the front over all systems as a line, settings on it filled."""
    figure = Figure(figsize=(11, 3.9), layout="constrained")
    panels = figure.subplots(1, len(COSTS), sharey=True)
    known = [one for one in record.means if one.costs]
    for axes, cost in zip(panels, COSTS, strict=True):
        on = [one.label for one in record.winners[cost]]
        line = [(one.budget, one.rel_mse) for one in record.winners[cost]]
        axes.step(*zip(*line, strict=True), where="post", color="#bbbbbb", linewidth=1.2) if line else None
        for one in known:
            _point(axes, one, cost, colours[one.system], is_on=one.label in on)
        for one in record.means:
            if not one.costs:
                axes.axhline(one.rel_mse, color=colours[one.system], linewidth=1, linestyle=":")
        logarithmic(axes)
        _label(axes, cost)
    panels[0].set_ylabel("relMSE")
    systems = list(dict.fromkeys(one.system for one in record.means))
    handles = [Patch(color=colours[name], label=name) for name in systems]
    _legend(figure, handles)
    return figure


def _legend(figure: Figure, handles: Sequence[Patch]) -> None:
    """Name the systems below the panels, in rows of about equal length."""
    rows = -(-len(handles) // _MOST_NAMES) or 1
    columns = -(-len(handles) // rows) or 1
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, fontsize=8.5)


def _label(axes: Axes, cost: str) -> None:
    """Name the cost, and label its ticks with units, as many as there is room for."""
    axes.set_xlabel(_COST_LABELS[cost], fontsize=9)
    count_in(axes, unit_of(cost))
    low, high = axes.get_xlim()
    if np.log10(high / low) > _DECADES:
        axes.xaxis.set_minor_formatter(NullFormatter())


def _point(axes: Axes, one: MeanRecord, cost: str, colour: str, *, is_on: bool) -> None:
    low, high = one.ci95
    bars = [[one.rel_mse - low], [high - one.rel_mse]]
    face = colour if is_on else "white"
    axes.errorbar(
        one.costs[cost], one.rel_mse, yerr=bars, fmt="o", color=colour, markerfacecolor=face, markersize=6, capsize=2
    )


def _range(classes: Sequence[ClassRecord], cost: str) -> tuple[float, float]:
    """Limits of an axis: from below the cheapest setting to beyond the dearest."""
    values = [one.costs[cost] for record in classes for one in record.means if one.costs]
    if not values or max(values) <= 0:
        return 0.1, 1.0
    return max(min(values), max(values) * 1e-9) / 1.5, max(values) * 1.5


def _band(axes: Axes, row: int, winners: Sequence[WinnerRecord], colours: Mapping[str, str]) -> None:
    low, high = axes.get_xlim()
    ends = [*(one.budget for one in winners[1:]), high][: len(winners)]
    for one, end in zip(winners, ends, strict=True):
        start = max(one.budget, low)
        colour = colours[one.system]
        axes.barh(row, end - start, left=start, height=0.74, color=colour, edgecolor="white", linewidth=1)
        text = ("< " if one.is_bound else "") + readable(one.rel_mse, 2) + (" ≈" if one.level_with else "")
        if np.log(end / start) / np.log(high / low) > _LETTER * len(text):
            ink = "white" if np.dot(to_rgb(colour), (0.299, 0.587, 0.114)) < 0.55 else "black"
            axes.text(np.sqrt(start * end), row, text, ha="center", va="center", fontsize=7, color=ink)

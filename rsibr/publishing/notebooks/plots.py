"""Ready-made plots: `bake.show()`, `report.plot()`, `study.plot()`."""

from __future__ import annotations

import importlib
import math

import numpy as np
from matplotlib.figure import Figure

from rsibr.publishing.notebooks.colours import of_maps
from rsibr.shown_progress import shell
from rsibr.store.bake import Bake
from rsibr.studies.figures import colour_of, count_in, headline, logarithmic, styled
from rsibr.studies.runner import Study
from rsibr.validation.results import Validation

_MOST_MAPS = 12
_COLUMNS = 6


def show_bake(bake: Bake, *, most: int = _MOST_MAPS) -> Figure:
    """Stored maps side by side, at one exposure.

    Parameters
    ----------
    bake : Bake
        A finished bake.
    most : int
        Maps to show; of more views they are spread evenly.
    """
    chosen = np.unique(np.linspace(0, bake.view_count - 1, min(bake.view_count, most)).astype(int))
    columns = min(len(chosen), _COLUMNS)
    rows = math.ceil(len(chosen) / columns)
    figure = Figure(figsize=(1.7 * columns, 1.9 * rows), layout="constrained")
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in places:
        axes.axis("off")
    for axes, picture, index in zip(places, of_maps([bake.map(int(k)) for k in chosen]), chosen, strict=False):
        axes.imshow(picture)
        axes.set_title("({:+.2f}, {:+.2f}, {:+.2f})".format(*bake.directions[index]), fontsize=7.5)
    return _displayed(figure)


@styled
def _error_and_time(validation: Validation) -> Figure:
    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.subplots()
    floor = float(np.mean([view.noise_floor for view in validation.views]))
    least = max(floor / 10, 1e-12)  # an estimate may be negative
    axes.axhspan(least / 2, floor, color="#e8e8e8", zorder=0)
    for name, one in validation.summary.items():
        value, low, high = (max(x, least) for x in (one.rel_mse.value, *one.rel_mse_range))
        bars = [[value - min(low, value)], [max(high, value) - value]]
        axes.errorbar(
            one.seconds, value, yerr=bars, fmt="o", color=colour_of(name), capsize=2, markersize=6, label=name
        )
    logarithmic(axes)
    axes.set(xlabel="time a map", ylabel="relMSE: mean, least, largest view", ylim=(least / 2, None))
    count_in(axes, "s")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def plot_validation(validation: Validation) -> Figure:
    """Error of each method over its time a map; grey: below the noise of the reference."""
    return _displayed(_error_and_time(validation))


def plot_study(study: Study) -> Figure:
    """Least error over the time of the whole job, and the gain of twice the time; see `rsibr.plots` for others."""
    return _displayed(headline(study.document))


def _displayed(figure: Figure) -> Figure:
    """See that a notebook shows figures that no `pyplot` made."""
    running = shell()
    if running is not None:
        importlib.import_module("IPython.core.pylabtools").select_figure_formats(running, {"png"})
    return figure

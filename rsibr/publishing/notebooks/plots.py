"""Ready-made plots: `bake.show()`, `report.show()`, `report.plot()`, `study.plot()`."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from rsibr.errors import InputError
from rsibr.publishing.notebooks.colours import of_maps
from rsibr.publishing.notebooks.side_by_side import displayed, side_by_side
from rsibr.store.bake import Bake
from rsibr.store.png_file import Rgba, tone_mapped
from rsibr.studies.figures import colour_of, count_in, headline, logarithmic, styled
from rsibr.studies.runner import Study
from rsibr.validation.report.pictures import RELATIVE_ERROR, display_exposure, false_colour
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
    titles = ["({:+.2f}, {:+.2f}, {:+.2f})".format(*bake.directions[index]) for index in chosen]
    return side_by_side(zip(titles, of_maps([bake.map(int(index)) for index in chosen]), strict=True))


def show_validation(validation: Validation, *, view: int = 0, errors: bool = False) -> Figure:
    """Reference of one view and the map by each method, at one exposure, with their relMSE.

    Parameters
    ----------
    validation : Validation
        Results of `rsibr.validate`.
    view : int
        Number of the view.
    errors : bool
        Whether to show below each map the relative error of its texels, noise of the reference included.
    """
    of = validation.views[view]
    reference = of.reference
    exposure = display_exposure([one.reference for one in validation.views])
    shown: list[tuple[str, Rgba | None]] = [
        ("reference", tone_mapped(reference.mean, reference.coverage, exposure)),
        *(
            (f"{name}\nrelMSE {one.error.rel_mse}", tone_mapped(one.image, reference.coverage, exposure))
            for name, one in of.methods.items()
        ),
    ]
    if not errors:
        return side_by_side(shown, columns=_COLUMNS - 1)
    below = [("", false_colour(one.error.relative_error, RELATIVE_ERROR)) for one in of.methods.values()]
    return side_by_side([*shown, ("", None), *below], columns=len(shown), scale=RELATIVE_ERROR)


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
    return displayed(_error_and_time(validation))


def plot_study(study: Study) -> Figure:
    """Least error over the time of the whole job, and the gain of twice the time; see `rsibr.plots` for others.

    Raises
    ------
    InputError
        If the study measured errors only.
    """
    if not study.document.doubling:
        fix = "study.to_dataframe() has the errors; leave `judge.errors_only` out to measure times"
        raise InputError("only errors were measured, no times to plot them over", where=study.document.name, fix=fix)
    return displayed(headline(study.document))

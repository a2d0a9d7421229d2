"""Pictures side by side in one figure, each with its title."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from rsibr.shown_progress import shell
from rsibr.store.png_file import Rgba
from rsibr.validation.report.pictures import COLOUR_MAP, Scale

_WIDTH = 12.0
"""Width of the figure with as many columns as it may have [inches]."""

_BAR = 1.2
"""Width of a scale with its text [inches]."""

_TITLE = 0.2
"""Height of a line of a title [inches]."""


def side_by_side(
    pictures: Iterable[tuple[str, Rgba | None]], *, columns: int = 6, scale: Scale | None = None
) -> Figure:
    """Figure of pictures in rows, cropped to what is not transparent.

    Parameters
    ----------
    pictures : iterable of (str, ndarray of shape (H, W, 4) and uint8)
        Title and picture, as `rsibr.pictures.tone_mapped` and `false_colour` make it; None for an empty place.
    columns : int
        Pictures in a row.
    scale : Scale, optional
        Scale to draw beside them, such as `rsibr.pictures.RELATIVE_ERROR`.

    Returns
    -------
    matplotlib.figure.Figure
        Which a notebook shows.

    Examples
    --------
    >>> grey = np.full((8, 8, 4), 128, dtype=np.uint8)
    >>> len(side_by_side([("left", grey), ("right", grey)]).axes)
    2
    """
    shown = [(title, None if picture is None else cropped(picture)) for title, picture in pictures]
    columns = min(columns, max(len(shown), 1))
    rows = math.ceil(len(shown) / columns)
    bar = 0.0 if scale is None else _BAR
    width = min((_WIDTH - bar) / columns, 3.0)
    aspects = [one.shape[0] / one.shape[1] for _, one in shown if one is not None]
    height = width * min(max(aspects, default=1.0), 1.0)
    lines = max((title.count("\n") + 1 for title, _ in shown), default=1)
    figure = Figure(figsize=(width * columns + bar, (height + _TITLE * lines) * rows), layout="constrained")
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in places:
        axes.axis("off")
    for axes, (title, picture) in zip(places, shown, strict=False):
        if picture is not None:
            axes.imshow(picture, interpolation="nearest")
            axes.set_title(title, fontsize=8)
    if scale is not None:
        _add_scale(figure, scale)
    return displayed(figure)


def _add_scale(figure: Figure, scale: Scale) -> None:
    norm = (LogNorm if scale.logarithmic else Normalize)(scale.low, scale.high)
    bar = figure.colorbar(ScalarMappable(norm, COLOUR_MAP), ax=figure.axes, shrink=0.8)
    bar.set_label(scale.label, fontsize=8)
    bar.ax.tick_params(labelsize=8)
    bar.set_ticks([value for value, _ in scale.ticks], labels=[text for _, text in scale.ticks], minor=False)
    bar.minorticks_off()


def displayed(figure: Figure) -> Figure:
    """See that a notebook shows figures that no `pyplot` made."""
    running = shell()
    if running is not None:
        importlib.import_module("IPython.core.pylabtools").select_figure_formats(running, {"png"})
    return figure


def cropped(picture: Rgba) -> Rgba:
    """Part of a picture that is not transparent; all of it if it is."""
    opaque = picture[..., 3] > 0
    if not opaque.any():
        return picture
    (top, bottom), (left, right) = (np.flatnonzero(opaque.any(axis=side))[[0, -1]] for side in (1, 0))
    return picture[top : bottom + 1, left : right + 1]

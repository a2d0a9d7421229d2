"""Sheet of pictures of one view: truth, each method and its prediction alone, with the signed error below."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rsibr.geometry.frame import view_frame
from rsibr.methods.reconstruction import run
from rsibr.store.noise import COVERED
from tests.worst_light.judged import METHODS, Lit
from tests.worst_light.scenes import Array

OWN = ("rsibr", "rsibr-fine")


def write_sheet(path: Path, lit: Lit, view: Array) -> None:
    """Write radiance, on a logarithmic scale, and error over (truth² + ε)^½, blue where it is too dark."""
    truth = lit.truth(view)
    judged, frame = truth.coverage >= COVERED, view_frame(view)
    images = {"truth": truth.mean} | {method: lit.map(method, view) for method in METHODS}
    for method in OWN:
        predicted = run(lit.methods.variant(method, uses_maps=False), frame, lit.resolution)
        images[f"{method}, prediction"] = predicted.image
    grey = {name: np.where(judged, image.mean(axis=-1), np.nan) for name, image in images.items()}
    true = grey["truth"]
    scale = np.sqrt(true**2 + (0.1 * np.nanmean(true)) ** 2)
    figure = Figure(figsize=(2.6 * len(grey), 5.6), layout="constrained")
    above, below = figure.subplots(2, len(grey))
    brightest = float(np.log10(np.nanmax(true)))
    for up, down, (name, radiance) in zip(above, below, grey.items(), strict=True):
        up.imshow(np.log10(np.maximum(radiance, 1e-6)), vmin=brightest - 4, vmax=brightest, cmap="inferno")
        up.set_title(f"{name}, max {np.nanmax(radiance):.3g}", fontsize=8)
        error = (radiance - true) / scale
        down.imshow(error, vmin=-1, vmax=1, cmap=mpl.colormaps["seismic"])
        down.set_title(f"root mean square {np.sqrt(np.nanmean(error**2)):.3f}", fontsize=8)
    for axes in figure.axes:
        axes.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=70)

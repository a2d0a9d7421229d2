"""One tone curve for all pictures of a gallery, so that a night sky and a noon sun are both legible and comparable."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

BRIGHT_PERCENTILE, BRIGHT = 95.0, 0.8
"""This percentile of the brightest picture is shown at this share of white: one texel of a sun decides nothing."""

DARK_PERCENTILE, DARK = 75.0, 0.03
"""This percentile of the darkest picture is shown at least at this share of white, 0.19 of the way up in sRGB."""

_RANGE = 1e6
"""Pictures brighter or darker than the median one by more than this decide nothing: outliers."""

_CONTRASTS = -6.0, 14.0
"""Powers of ten between which the contrast lies: enough for the whole range twice."""


@dataclass(frozen=True)
class ToneCurve:
    """Linear radiance to linear display values.

    Attributes
    ----------
    white : float
        Radiance that is shown as white.
    contrast : float
        Curvature c of y = ln(1 + c x/white) / ln(1 + c); 0: linear.
    dark, bright : float
        Radiance of the darkest and the brightest picture, from which the curve was chosen.

    Notes
    -----
    Drago et al., *Adaptive Logarithmic Mapping For Displaying High Contrast Scenes* (2003), eq. 1, with one base for
    all: the same radiance has the same colour in every picture.
    """

    white: float
    contrast: float
    dark: float
    bright: float

    @classmethod
    def of(cls, pictures: Iterable[NDArray[np.floating]]) -> ToneCurve:
        """Choose the curve with the least curvature that shows the darkest picture.

        Parameters
        ----------
        pictures : iterable of ndarray, each of shape (H, W, 3)
            Linear radiance; what is not finite or not positive is ignored, as are black pictures.
        """
        found = [levels for levels in map(_levels, pictures) if levels is not None]
        if not found:
            return cls(white=1.0, contrast=0.0, dark=1.0, bright=1.0)
        dark, bright = np.array(found).T
        typical = float(np.median(bright))
        highest = float(bright[bright <= typical * _RANGE].max())
        lowest = float(dark[dark >= typical / _RANGE].min(initial=typical))
        white = highest / BRIGHT
        return cls(white, _contrast(lowest / white), lowest, highest)

    def __call__(self, radiance: NDArray[np.floating]) -> NDArray[np.float64]:
        """Linear display values in [0, 1] of radiance of shape (…, 3); NaN is 0.

        The curve is that of the largest channel; the others keep their ratio to it, so that no colour fades.
        """
        share = np.maximum(np.nan_to_num(radiance.astype(np.float64), nan=0.0, posinf=self.white) / self.white, 0.0)
        largest = share.max(axis=-1, keepdims=True)
        shown = _curve(np.minimum(largest, 1.0), self.contrast)
        gain = np.divide(shown, largest, out=np.zeros_like(largest), where=largest > 0)
        return np.asarray(np.minimum(share * gain, 1.0))

    @property
    def stops(self) -> int:
        """Exposure at which the darkest picture is as bright as the brightest is now, rounded up [EV]."""
        return math.ceil(math.log2(self.white / self.dark))

    def __str__(self) -> str:
        shape = "linear below" if self.contrast == 0 else "logarithmic below"
        return f"white is a radiance of {self.white:.3g}, {shape}"


def _curve(share: NDArray[np.float64], contrast: float) -> NDArray[np.float64]:
    return share if contrast == 0 else np.log1p(contrast * share) / np.log1p(contrast)


def _contrast(darkest: float) -> float:
    """Least contrast that shows this share of white at `DARK` or more."""
    if darkest >= DARK:
        return 0.0

    def excess(power: float) -> float:
        return float(_curve(np.array(darkest), 10.0**power)) - DARK

    return float(10.0 ** brentq(excess, *_CONTRASTS))


def _levels(picture: NDArray[np.floating]) -> tuple[float, float] | None:
    """Levels that the curve shows dark and bright, of a picture; None if it is black."""
    brightest = np.nan_to_num(picture, nan=0.0, posinf=0.0).max(axis=-1)
    lit = brightest[brightest > 0]
    if not lit.size:
        return None
    dark, bright = np.percentile(lit, (DARK_PERCENTILE, BRIGHT_PERCENTILE))
    return float(dark), float(bright)

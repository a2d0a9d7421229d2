"""Error against time on logarithmic axes: the slope of a straight line, and the point where noise equals bias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.stats import t as student_t

LEAST_POINTS = 3
"""Fewest points of a slope; two have no scatter for a confidence interval."""


WIDEST = 2.0
"""Largest ratio of the ends of a 95 % interval for which a gain of twice the time is told; half a unit of a slope."""

_EQUAL = 1e-9
"""Spread of logarithms below which values differ by rounding."""

_UNKNOWN = 100.0
"""Half the interval of a slope that equal x do not tell."""

LEAST_FALL = 0.05
"""Slope below which a line counts as level: where it would reach another value is beyond all that was measured."""


@dataclass(frozen=True)
class PowerLaw:
    """A straight line on logarithmic axes: y = scale·x^slope.

    Attributes
    ----------
    slope, scale : float
    ci95 : tuple of two floats
        Confidence interval of the slope, from the scatter of the points about the line.
    range : tuple of two floats
        Least and largest x that it was fitted to.
    points : int
        Number of points that it was fitted to.
    """

    slope: float
    scale: float
    ci95: tuple[float, float]
    range: tuple[float, float]
    points: int = LEAST_POINTS

    @property
    def is_measured(self) -> bool:
        """Whether the interval of the slope is narrow enough for a statement on twice the time; see `WIDEST`."""
        return self.ci95[1] - self.ci95[0] <= math.log2(WIDEST)

    def covers(self, x: float) -> bool:
        """Whether the line can be trusted at x: within the measured range, or anywhere if the slope is measured."""
        return self.is_measured or self.range[0] <= x <= self.range[1]

    def at(self, x: float) -> float:
        """Value at x > 0."""
        return self.scale * math.exp(self.slope * math.log(x))

    def where(self, y: float) -> float | None:
        """Place x at which the value has fallen to y; None where that is not positive, or the line does not fall."""
        if y <= 0 or self.slope > -LEAST_FALL:
            return None
        return math.exp(math.log(y / self.scale) / self.slope)


def fit_power_law(x: Sequence[float], y: Sequence[float]) -> PowerLaw:
    """Fit y = scale·x^slope by least squares in the logarithms.

    Parameters
    ----------
    x, y : sequence of float
        At least three, positive. Where all x are equal the slope is 0, and its interval says that it is unknown.

    Raises
    ------
    ValueError
        If there are fewer than three points, or one is not positive.
    """
    if len(x) < LEAST_POINTS or min(*x, *y) <= 0:
        raise ValueError("a slope needs three points at least, all positive")
    log_x, log_y = np.log(x), np.log(y)
    spread = float(np.sum((log_x - log_x.mean()) ** 2))
    if spread < _EQUAL**2:
        return PowerLaw(0.0, math.exp(log_y.mean()), (-_UNKNOWN, _UNKNOWN), (min(x), max(x)), len(x))
    slope, intercept = (float(c) for c in np.polyfit(log_x, log_y, 1))
    scatter = float(np.sum((log_y - slope * log_x - intercept) ** 2)) / (len(x) - 2)
    error = math.sqrt(scatter / spread)
    reach = float(student_t.ppf(0.975, len(x) - 2)) * error
    return PowerLaw(slope, math.exp(intercept), (slope - reach, slope + reach), (min(x), max(x)), len(x))


@dataclass(frozen=True)
class Flattening:
    """Error over samples: y = bias + noise/samples.

    Attributes
    ----------
    bias : float
        Error that no number of samples takes away.
    noise : float
        Error times samples of the part that falls.
    """

    bias: float
    noise: float

    def at(self, samples: float) -> float:
        """Error at a number of samples."""
        return self.bias + self.noise / samples

    @property
    def samples(self) -> float | None:
        """Samples at which noise and bias are equal; beyond, more samples gain little. None without a bias."""
        return self.noise / self.bias if self.bias > 0 else None


def fit_flattening(samples: Sequence[float], errors: Sequence[float]) -> Flattening:
    """Fit a non-negative bias and noise to errors, by their ratios to the fit.

    Parameters
    ----------
    samples, errors : sequence of float
        At least two, the samples positive.

    Raises
    ------
    ValueError
        If there are fewer than two points or an error is not positive.
    """
    n, e = np.asarray(samples, np.float64), np.asarray(errors, np.float64)
    if len(n) < 2 or (n <= 0).any() or (e <= 0).any():
        raise ValueError("a flattening needs two points at least, all positive")
    (bias, noise), _ = nnls(np.stack([1 / e, 1 / (n * e)], axis=1), np.ones(len(e)))
    return Flattening(float(bias), float(noise))

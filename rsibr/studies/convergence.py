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
    """

    slope: float
    scale: float
    ci95: tuple[float, float]
    range: tuple[float, float]

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
        At least three, positive.

    Raises
    ------
    ValueError
        If there are fewer than three points, or one is not positive.
    """
    if len(x) < LEAST_POINTS or min(*x, *y) <= 0:
        raise ValueError("a slope needs three points at least, all positive")
    log_x, log_y = np.log(x), np.log(y)
    slope, intercept = (float(c) for c in np.polyfit(log_x, log_y, 1))
    scatter = float(np.sum((log_y - slope * log_x - intercept) ** 2)) / (len(x) - 2)
    error = math.sqrt(scatter / float(np.sum((log_x - log_x.mean()) ** 2)))
    reach = float(student_t.ppf(0.975, len(x) - 2)) * error
    return PowerLaw(slope, math.exp(intercept), (slope - reach, slope + reach), (min(x), max(x)))


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

"""Estimates with confidence intervals, and the jackknife that computes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

CONFIDENCE = 0.95

_PLAIN = (-3, 5)
"""Exponents of ten between which a number is written without a power of ten."""

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Estimate:
    """Estimate of a number from noisy data.

    Attributes
    ----------
    value : float
        Estimated value; a debiased error may be slightly negative.
    standard_error : float
        Standard deviation of the estimate due to the noise of the reference.
    degrees_of_freedom : float
        Degrees of freedom of Student's t; may be infinite if the standard error is zero.
    """

    value: float
    standard_error: float
    degrees_of_freedom: float

    @property
    def ci95(self) -> tuple[float, float]:
        """Confidence interval of 95 % by Student's t: lower and upper end."""
        if self.standard_error == 0.0:
            return self.value, self.value
        reach = float(student_t.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom)) * self.standard_error
        return self.value - reach, self.value + reach

    @property
    def below_noise_floor(self) -> bool:
        """Whether the error is not significantly greater than zero: the interval contains zero or lies below it."""
        low, high = self.ci95
        return low <= 0.0 and not low == high == 0.0

    def __str__(self) -> str:
        """Return value and half the interval: `0.01234 ± 0.00047`, `(3.68 ± 0.11) × 10⁻⁴`."""
        low, high = self.ci95
        if self.below_noise_floor:
            return f"below the noise floor, < {readable(high, 2)}" if high > 0 else "below the noise floor"
        if low == high:
            return readable(self.value)
        return with_uncertainty(self.value, (high - low) / 2)


def readable(value: float, digits: int = 3) -> str:
    """Format a number: `0.0123`, `2.85 × 10⁻⁵`, `240`.

    Parameters
    ----------
    value : float
        Number to format.
    digits : int
        Significant digits.

    Returns
    -------
    str
    """
    if value == 0:
        return "0"
    exponent = _exponent(float(f"{value:.{digits - 1}e}"))  # of the rounded value: 9.999 becomes 10.0
    if _PLAIN[0] <= exponent < _PLAIN[1]:
        return f"{round(value, digits - 1 - exponent):.{max(digits - 1 - exponent, 0)}f}"
    return f"{value / 10.0**exponent:.{digits - 1}f} × {_power_of_ten(exponent)}"


def with_uncertainty(value: float, half: float) -> str:
    """Format value and half its interval, the latter to two digits, with a common power of ten: `0.0123 ± 0.0004`."""
    if half == 0:
        return readable(value)
    exponent = _exponent(max(abs(value), half))
    plain = _PLAIN[0] <= exponent < _PLAIN[1]
    unit = 1.0 if plain else 10.0**exponent
    decimals = min(max(1 - _exponent(half / unit), 0), 6)
    both = f"{value / unit:.{decimals}f} ± {half / unit:.{decimals}f}"
    return both if plain else f"({both}) × {_power_of_ten(exponent)}"


def _exponent(value: float) -> int:
    return math.floor(math.log10(abs(value)))


def _power_of_ten(exponent: int) -> str:
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def jackknife(value: float, leave_one_out: NDArray[np.float64]) -> Estimate:
    """Jackknife: bias-corrected estimate from K independent buffers, with its standard error.

    Parameters
    ----------
    value : float
        Estimate from all buffers.
    leave_one_out : ndarray, shape (K,)
        Estimate without the k-th buffer.

    Returns
    -------
    Estimate
        Estimate with K − 1 degrees of freedom.

    Notes
    -----
    Quenouille (1956): K·value − (K−1)·mean(leave-one-out) removes bias of order 1/K, such as that of a ratio with a
    noisy numerator and denominator. Efron & Stein (1981): the expected variance of the jackknife is never too small. If
    the error is entirely noise it is up to twice the true variance, and the interval is conservative.
    """
    k = len(leave_one_out)
    variance = (k - 1) * float(np.var(leave_one_out))
    corrected = value + (k - 1) * (value - float(np.mean(leave_one_out)))
    return Estimate(corrected, math.sqrt(variance), k - 1)


def mean_estimate(estimates: Sequence[Estimate]) -> Estimate:
    """Mean of independent estimates, for example one for each view.

    Parameters
    ----------
    estimates : sequence of Estimate
        At least one.

    Returns
    -------
    Estimate
        The standard error is that of the mean over these views; it does not include the variation between views.
        Degrees of freedom by Welch (1947) and Satterthwaite (1946).
    """
    count = len(estimates)
    variances = np.array([e.standard_error**2 for e in estimates])
    dof = np.array([e.degrees_of_freedom for e in estimates])
    total = float(variances.sum())
    shares = variances / total if total > 0 else np.zeros(count)
    joint = 1.0 / float((shares**2 / dof).sum()) if total > 0 else math.inf
    return Estimate(float(np.mean([e.value for e in estimates])), math.sqrt(total) / count, joint)

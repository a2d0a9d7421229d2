"""An estimated number with its confidence interval, and the jackknife that gives it one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

CONFIDENCE = 0.95

_PLAIN = (-3, 5)
"""Powers of ten between which a number is written out."""

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Estimate:
    """A number that noise has touched.

    Attributes
    ----------
    value : float
        The estimate; a debiased error may come out slightly negative.
    standard_error : float
        Its standard deviation, from the noise of the reference alone.
    degrees_of_freedom : float
        Of Student's t; may be infinite where the standard error is zero.
    """

    value: float
    standard_error: float
    degrees_of_freedom: float

    @property
    def ci95(self) -> tuple[float, float]:
        """Confidence interval of 95 %, from Student's t."""
        if self.standard_error == 0.0:
            return self.value, self.value
        reach = float(student_t.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom)) * self.standard_error
        return self.value - reach, self.value + reach

    @property
    def below_noise_floor(self) -> bool:
        """Whether the reference is too noisy to tell the error from none: the interval holds zero or less."""
        low, high = self.ci95
        return low <= 0.0 and not low == high == 0.0

    def __str__(self) -> str:
        """Return the value as a person reads it: `0.01234 ± 0.00047`, `(3.68 ± 0.11) × 10⁻⁴`."""
        low, high = self.ci95
        if self.below_noise_floor:
            return f"below the noise floor, < {readable(high, 2)}" if high > 0 else "below the noise floor"
        if low == high:
            return readable(self.value)
        return _with_uncertainty(self.value, (high - low) / 2)


def readable(value: float, digits: int = 3) -> str:
    """Write a number for a person: `0.0123`, `2.85 × 10⁻⁵`, `240`.

    Parameters
    ----------
    value : float
    digits : int
        Significant digits.

    Returns
    -------
    str
    """
    if value == 0:
        return "0"
    exponent = _exponent(float(f"{value:.{digits - 1}e}"))  # of the rounded value: 9.99 may become 10
    if _PLAIN[0] <= exponent < _PLAIN[1]:
        return f"{round(value, digits - 1 - exponent):.{max(digits - 1 - exponent, 0)}f}"
    return f"{value / 10.0**exponent:.{digits - 1}f} × {_power_of_ten(exponent)}"


def _with_uncertainty(value: float, half: float) -> str:
    """Value and half its interval, the latter to two digits, both on one power of ten."""
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
    """Correct an estimate from K independent buffers by the jackknife, and attach its standard error.

    Parameters
    ----------
    value : float
        The estimate from all buffers.
    leave_one_out : ndarray, shape (K,)
        The estimate with the k-th buffer left out.

    Returns
    -------
    Estimate
        With K − 1 degrees of freedom.

    Notes
    -----
    Quenouille (1956): K·value − (K−1)·mean(leave-one-out) has no bias of the order 1/K left, such as that of a ratio
    with noise above and below the line. Efron & Stein (1981): the jackknife's variance is never too small on average.
    Where the error is all noise it is up to twice the true one, so the interval then covers more often than it says.
    """
    k = len(leave_one_out)
    variance = (k - 1) * float(np.var(leave_one_out))
    corrected = value + (k - 1) * (value - float(np.mean(leave_one_out)))
    return Estimate(corrected, math.sqrt(variance), k - 1)


def mean_estimate(estimates: Sequence[Estimate]) -> Estimate:
    """Mean of independent estimates, for example one a view.

    Parameters
    ----------
    estimates : sequence of Estimate
        At least one.

    Returns
    -------
    Estimate
        Its standard error is that of these very views; how much views differ among each other is not in it. Degrees of
        freedom after Welch (1947) and Satterthwaite (1946).
    """
    count = len(estimates)
    variances = np.array([e.standard_error**2 for e in estimates])
    dof = np.array([e.degrees_of_freedom for e in estimates])
    total = float(variances.sum())
    shares = variances / total if total > 0 else np.zeros(count)
    joint = 1.0 / float((shares**2 / dof).sum()) if total > 0 else math.inf
    return Estimate(float(np.mean([e.value for e in estimates])), math.sqrt(total) / count, joint)

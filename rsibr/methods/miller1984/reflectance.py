"""Convolution functions f_d and f_s of Miller & Hoffman (1984), sections 6.1 and 6.2, without their constants k."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VARNISH = 0.5
"""Mirror part of a clear varnish coat, as printed (section 6.2, example 3)."""

_NEGLIGIBLE = 1e-12
"""Value of a Phong function below which it counts as zero: a sun a million times the sky does not reach over it."""


@dataclass(frozen=True, eq=False)
class Reflectance:
    """Function f(x) of the cosine x between a table's direction and the light's.

    Attributes
    ----------
    values : callable or None
        x → f(x), an array for an array of cosines above `least`; None if there is nothing but the mirror part.
    least : float
        Cosine up to which f is zero.
    mirror : float
        Weight of a perfect mirror, f = 1 for x = 1 alone.

    Notes
    -----
    A table holds (Σ I Area f)/4π + mirror · I. As printed, a mirror's f is one term of the sum, and its value would
    depend on the area of a texel. The text says what is meant: the specular map of a mirror is the illumination map.
    """

    values: Callable[[Array], Array] | None
    least: float = 0.0
    mirror: float = 0.0


def lambert() -> Reflectance:
    """Lambert's f_d(x) = max(x, 0). The table under a constant sky of radiance 1 is k_d/4."""
    return Reflectance(lambda x: x)


def self_luminous() -> Reflectance:
    """Self-luminous material, f_d(x) = 1: the table is k_d times the mean radiance, the same everywhere."""
    return Reflectance(np.ones_like, least=-2.0)


def mirror() -> Reflectance:
    """Perfect mirror: the table is the illumination table."""
    return Reflectance(None, mirror=1.0)


def phong(n: float, mirror: float = 0.0) -> Reflectance:
    """Phong's f_s(x) = max(x, 0)ⁿ, and under varnish the mirror part.

    Parameters
    ----------
    n : float
        Exponent > 0. Under a constant sky of radiance 1 the table is k_s/(2(n + 1)).
    mirror : float
        0, or `VARNISH`.
    """
    return Reflectance(lambda x: np.exp(n * np.log(x)), least=_NEGLIGIBLE ** (1 / n), mirror=mirror)


def zonal(cosines: Array, values: Array) -> Reflectance:
    """Any function of the angle, given at `cosines` in ascending order, linear between them and zero below."""
    return Reflectance(lambda x: np.interp(x, cosines, values), least=float(cosines[0]))

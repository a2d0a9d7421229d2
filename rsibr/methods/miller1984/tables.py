"""Illumination table, diffuse map D and specular map S of Miller & Hoffman (1984): sizes, and the maps themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.latlong import POLAR
from rsibr.methods.miller1984.convolution import convolved
from rsibr.methods.miller1984.material_fit import PhongMaterial
from rsibr.methods.miller1984.reflectance import Reflectance, mirror, phong
from rsibr.methods.options import whole

Array = NDArray[np.float64]

ILLUMINATION_ROWS = 504
"""Rows of the illumination table, with twice as many columns: 0.36° a texel, as fine as the light of a bake. A multiple
of 36, so that the columns of the usual maps divide its own."""

MOST_ROWS = 1024
"""Most rows of a table: 50 MB of numbers, and some minutes of sums if both tables have as many."""

DIFFUSE_ROWS = 36
"""Rows of D, with twice as many columns; Miller & Hoffman (1984), section 6.1."""

_TEXELS = 4.0  # of S in the standard deviation 1/√n of a Phong lobe: bilinear lookups err by 1.6 % of its peak


@dataclass(frozen=True)
class Sizes:
    """Rows of the tables; each has twice as many columns.

    Attributes
    ----------
    illumination, diffuse : int
        Of I and of D.
    specular : int or None
        Of S; by default as its function asks: those of I if it has a mirror part, otherwise by the exponent.
    """

    illumination: int = ILLUMINATION_ROWS
    diffuse: int = DIFFUSE_ROWS
    specular: int | None = None

    def __post_init__(self) -> None:
        for name, rows in vars(self).items():
            if rows is not None:
                whole(f"{name}_rows", rows, 1, MOST_ROWS)

    def of_specular(self, n: float, mirrored: float) -> int:
        """Rows of S for the exponent `n` and the mirror part `mirrored`."""
        if self.specular is not None:
            return self.specular
        return self.illumination if mirrored else phong_rows(n, self.illumination)


def highest_exponent(rows: int) -> float:
    """Exponent whose Phong lobe has a standard deviation 1/√n of one texel of an illumination table of so many rows."""
    return (rows / math.pi) ** 2


def phong_rows(n: float, most: int) -> int:
    """Rows of a table of a Phong lobe: the fewest that divide `most` with `_TEXELS` of them in 1/√n, at least 36.

    Examples
    --------
    >>> phong_rows(10, 504), phong_rows(1000, 504)
    (42, 504)
    """
    wanted = min(max(_TEXELS * math.pi * math.sqrt(n), DIFFUSE_ROWS), most)
    return min(rows for rows in range(1, most + 1) if most % rows == 0 and rows >= wanted)


def diffuse_map(illumination: Array, k_d: Array, reflectance: Reflectance, rows: int = DIFFUSE_ROWS) -> Array:
    """Diffuse map D[N] = (Σ_L I Area f_d(N·L)) / 4π; Miller & Hoffman (1984), section 6.1.

    Parameters
    ----------
    illumination : ndarray, shape (H, W, 3)
        Illumination table I [W sr⁻¹ m⁻²].
    k_d : ndarray, shape (3,)
        Diffuse constant.
    reflectance : Reflectance
        `lambert()` or `self_luminous()`.
    rows : int
        Rows of the map, which has twice as many columns.

    Returns
    -------
    ndarray, shape (rows, 2 rows, 3)
    """
    # The transform leaves rounding below zero where it is dark
    return np.maximum(k_d * convolved(illumination, reflectance, rows, 2 * rows), 0.0)


def specular_map(illumination: Array, k_s: Array, reflectance: Reflectance, rows: int, phong_rows: int) -> Array:
    """Specular map S[R] = (Σ_L I Area f_s(R·L)) / 4π + mirror part · I[R]; Miller & Hoffman (1984), section 6.2.

    Parameters
    ----------
    illumination, k_s, reflectance, rows
        As of `diffuse_map`. A perfect mirror's map is k_s I; under varnish k_s scales the Phong part alone.
    phong_rows : int
        Rows at which the Phong part is summed; where they are others it is interpolated to those of the map.

    Returns
    -------
    ndarray, shape (rows, 2 rows, 3)
    """
    if reflectance.values is None:
        return k_s * reflectance.mirror * resized(illumination, rows)
    glossy = np.maximum(resized(k_s * convolved(illumination, reflectance, phong_rows, 2 * phong_rows), rows), 0.0)
    return glossy + (reflectance.mirror * resized(illumination, rows) if reflectance.mirror else 0.0)


def specular_reflectance(material: PhongMaterial) -> Reflectance:
    """Function f_s of a material."""
    return mirror() if math.isinf(material.n) else phong(material.n, material.mirror)


def resized(table: Array, rows: int) -> Array:
    """Bilinear lookup of a table of shape (H, 2H, 3) at the middles of the texels of one with other rows."""
    height = len(table)
    if rows == height:
        return table
    padded = np.asarray(POLAR.bordered(table.astype(np.float32)[None])[0], dtype=np.float64)
    for axis, count in ((0, rows), (1, 2 * rows)):
        place = (np.arange(count) + 0.5) * (height / rows) + 0.5
        below = place.astype(np.intp)
        part = np.expand_dims(place - below, tuple(k for k in range(3) if k != axis))
        padded = padded.take(below, axis) * (1 - part) + padded.take(below + 1, axis) * part
    return np.asarray(padded)

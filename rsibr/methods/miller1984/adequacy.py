"""How far lookups in a diffuse map of few texels are from the sum itself: the claim that 36 × 72 are adequate.

Miller & Hoffman (1984), section 6.1. The error meant is that of the lookup: table and reference are sums over the same
illumination table.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.latlong import POLAR
from rsibr.light.projected import light_in
from rsibr.light.radiance import light_of
from rsibr.methods.miller1984.convolution import convolved, texel_areas
from rsibr.methods.miller1984.polar_table import Lookup
from rsibr.methods.miller1984.reflectance import Reflectance, lambert
from rsibr.methods.miller1984.tables import DIFFUSE_ROWS, resized
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment

Array = NDArray[np.float64]

FINER = 7
"""Directions at which a lookup is judged, along a side of a texel."""


_DARK = 0.1
"""Part of the mean brightness that is added to a direction's own, so that dark directions do not decide alone."""


@dataclass(frozen=True, eq=False)
class TableError:
    """Errors of lookups in a map; brightness is the mean of the channels.

    Attributes
    ----------
    rel_rmse : float
        Root of the mean over the sphere of (a − b)²/(b² + ε), with ε = (0.1 mean b)²: the project's metric.
    worst : float
        Greatest |a − b|/√(b² + ε).
    of_peak : float
        Greatest |a − b| over the greatest b.
    exact, looked_up : ndarray, shape (H, 2H, 3)
        The sums b, and what the lookups return, a.
    """

    rel_rmse: float
    worst: float
    of_peak: float
    exact: Array
    looked_up: Array


@backend.in_session
def illumination_table(file: Path | str, rows: int = 252) -> Array:
    """Illumination table of an environment file, shape (rows, 2 rows, 3) [W sr⁻¹ m⁻²]."""
    light = light_of(load_environment(EnvironmentConfig(file=Path(file))), with_image=False)
    return np.asarray(light_in(light, POLAR, rows)[0], dtype=np.float64)


def lookup_error(
    illumination: Array,
    rows: int = DIFFUSE_ROWS,
    lookup: Lookup = "bilinear",
    reflectance: Reflectance | None = None,
) -> TableError:
    """Error of lookups in a map of `rows` × 2 `rows` texels, at 7 × 7 directions in each.

    Parameters
    ----------
    illumination : ndarray, shape (H, W, 3)
        Illumination table I; fastest where 14 · rows divides W.
    rows : int
        Rows of the map.
    lookup : {"bilinear", "nearest"}
        How it is read.
    reflectance : Reflectance, optional
        Function that I is convolved with; by default Lambert's.

    Examples
    --------
    >>> grey = np.ones((84, 168, 3))
    >>> lookup_error(grey, 12).worst < 1e-3
    True
    """
    f = lambert() if reflectance is None else reflectance
    table, exact = (convolved(illumination, f, count, 2 * count) for count in (rows, FINER * rows))
    is_nearest = lookup == "nearest"
    found = table.repeat(FINER, axis=0).repeat(FINER, axis=1) if is_nearest else resized(table, FINER * rows)
    b, areas = exact.mean(axis=-1), texel_areas(len(exact), exact.shape[1])[..., 0] / (4 * np.pi)
    off = np.abs(found.mean(axis=-1) - b)
    relative = off / np.sqrt(b**2 + (_DARK * (b * areas).sum()) ** 2)
    return TableError(
        rel_rmse=float(np.sqrt((relative**2 * areas).sum())),
        worst=float(relative.max()),
        of_peak=float(off.max() / b.max()),
        exact=exact,
        looked_up=found,
    )

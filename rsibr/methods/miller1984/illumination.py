"""Illumination table I of Miller & Hoffman (1984), sections 4.3 and 5: mean radiance by polar coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.latlong import POLAR
from rsibr.light.projected import light_in
from rsibr.light.radiance import Light


def illumination_table(light: Light, rows: int) -> NDArray[np.float64]:
    """Illumination table of a bake's light.

    Parameters
    ----------
    light : Light
        Light of the bake.
    rows : int
        Rows of the table, which has twice as many columns.

    Returns
    -------
    ndarray, shape (rows, 2 rows, 3)
        Mean radiance over each texel [W sr⁻¹ m⁻²]. A light without extent is added to the texel in its direction as
        its irradiance over the texel's area (section 5.2).
    """
    return np.asarray(light_in(light, POLAR, rows, delta=True)[0], dtype=np.float64)

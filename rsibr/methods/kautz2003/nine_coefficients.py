"""Nine spherical-harmonic coefficients of the light from the faces of a cube; Kautz et al. (2003), section 4.1."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from rsibr.light.harmonic_irradiance import harmonics
from rsibr.methods.kautz2003.faces import averaged

Array = NDArray[np.float64]

FACE = 8
"""Texels a side of the faces that coefficients are computed from: what the paper calls enough (section 5.1.1)."""


def coefficients(faces: NDArray[np.floating[Any]], face: int = FACE) -> Array:
    """Coefficients L_i = ∫ L Y_i dω of the light; Kautz et al. (2003), eq. 11.

    Parameters
    ----------
    faces : ndarray, shape (6, N, N, 3)
        Mean radiance [W sr⁻¹ m⁻²] over the texels of a cube (projection "cube").
    face : int
        Texels a side that the light is averaged to before; finer faces are reduced, coarser ones taken as they are.

    Returns
    -------
    ndarray, shape (9, 3)
        In W m⁻² sr⁻¹ times √sr.

    Notes
    -----
    One point a texel: its centre, weighted by its solid angle.
    """
    small = averaged(faces, min(face, faces.shape[1]))
    return np.asarray(_weights(small.shape[1]) @ small.reshape(-1, 3).astype(np.float64))


@lru_cache(maxsize=8)
def _weights(face: int) -> Array:
    """Y_i times solid angle at the texel centres, shape (9, 6·face²)."""
    cube = projection("cube")
    x, y, z = np.array(texel_directions(cube, face), dtype=np.float64)
    return np.stack(harmonics(x, y, z)) * texel_solid_angles(cube, face).reshape(-1)

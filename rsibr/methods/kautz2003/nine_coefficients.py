"""Diffuse reflection from nine spherical-harmonic coefficients of the light; Kautz et al. (2003), section 4.1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from rsibr.geometry.to_device import to_device
from rsibr.methods.kautz2003.faces import averaged

Array = NDArray[np.float64]

COSINE_LOBE = (math.pi, *[2 * math.pi / 3] * 3, *[math.pi / 4] * 5)
"""Factors Â_i of the clamped cosine in the bands of the nine functions; Ramamoorthi & Hanrahan (2001), eq. 19."""

FACE = 8
"""Texels a side of the faces that coefficients are computed from: what the paper calls enough (section 5.1.1)."""


def basis(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Real spherical harmonics of bands 0 to 2 at a unit direction; Kautz et al. (2003), eq. 9.

    Parameters
    ----------
    x, y, z : float, ndarray or mi.Float
        Components of the direction.

    Returns
    -------
    tuple of nine
        Y_0, …, Y_8; orthonormal over the sphere.

    Examples
    --------
    >>> [round(value, 4) for value in basis(0.0, 0.0, 1.0)]
    [0.2821, 0.0, 0.4886, 0.0, 0.0, 0.0, 0.6308, 0.0, 0.0]
    """
    first, second, last = (math.sqrt(k / (4 * math.pi)) for k in (3, 15, 5))
    return (
        math.sqrt(1 / (4 * math.pi)) + 0 * x,
        first * y,
        first * z,
        first * x,
        second * x * y,
        second * y * z,
        last / 2 * (3 * z * z - 1),
        second * x * z,
        second / 2 * (x * x - y * y),
    )


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
    return np.stack(basis(x, y, z)) * texel_solid_angles(cube, face).reshape(-1)


@dataclass(eq=False)
class NineCoefficients:
    """Coefficients on the device.

    Attributes
    ----------
    factors : mi.Float
        Â_i L_i / π in three channels, flat.
    """

    factors: mi.Float

    @classmethod
    def of(cls, values: Array) -> NineCoefficients:
        """Put coefficients of shape (9, 3) on the device."""
        scaled = values * np.array(COSINE_LOBE)[:, None] / math.pi
        return cls(to_device(mi.Float, scaled.astype(np.float32)))

    def diffuse(self, n: mi.Vector3f) -> mi.Color3f:
        """Radiance of a white Lambertian surface, Σ Â_i L_i Y_i(n) / π; Kautz et al. (2003), eq. 12.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²]. Opposite a small strong light the sum falls below zero; it is cut off there, as a
            frame buffer does.
        """
        total = mi.Color3f(0)
        for i, value in enumerate(basis(n.x, n.y, n.z)):
            total += dr.gather(mi.Color3f, self.factors, mi.UInt32(i)) * value
        return dr.maximum(total, 0)

"""Irradiance from nine spherical-harmonic coefficients of the light; Ramamoorthi & Hanrahan (2001)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.geometry.to_device import to_device
from rsibr.light.radiance import Light

Array = NDArray[np.float64]

COSINE_LOBE = (math.pi, *[2 * math.pi / 3] * 3, *[math.pi / 4] * 5)
"""Factors Â_i of the clamped cosine in the bands of the nine functions; Ramamoorthi & Hanrahan (2001), eq. 8 and 9."""


def harmonics(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Real spherical harmonics of bands 0 to 2 at a unit direction; Ramamoorthi & Hanrahan (2001), eq. 3.

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
    >>> [round(value, 4) for value in harmonics(0.0, 0.0, 1.0)]
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


def harmonic_coefficients(directions: Array, energies: Array) -> Array:
    """Coefficients ∫ L Y dω of point sources.

    Parameters
    ----------
    directions : ndarray, shape (n, 3)
        Unit directions.
    energies : ndarray, shape (n, 3)
        Radiance times solid angle, or the irradiance of a light without extent [W m⁻²].

    Returns
    -------
    ndarray, shape (9, 3)
    """
    return np.asarray(np.stack(harmonics(*directions.T)) @ energies)


def light_coefficients(light: Light, *, delta: bool = False) -> Array:
    """Coefficients of a bake's light, shape (9, 3); with `delta` its lights without extent are included."""
    size = len(light.picture)
    directions = np.array(texel_directions(size), dtype=np.float64).T
    found = harmonic_coefficients(directions, light.picture.reshape(-1, 3) * texel_solid_angles(size)[:, None])
    if delta and len(light.delta):
        found += harmonic_coefficients(light.delta.directions.astype(float), light.delta.irradiance.astype(float))
    return found


@dataclass(eq=False)
class HarmonicIrradiance:
    """Irradiance as a quadratic polynomial of the normal.

    Attributes
    ----------
    factors : mi.Float
        Â_i L_i / π in three channels, flat.
    """

    factors: mi.Float

    @classmethod
    def of(cls, coefficients: Array) -> HarmonicIrradiance:
        """Put coefficients of the light, shape (9, 3), on the device."""
        scaled = coefficients * np.array(COSINE_LOBE)[:, None] / math.pi
        return cls(to_device(mi.Float, scaled.astype(np.float32)))

    def mean_radiance(self, n: mi.Vector3f) -> mi.Color3f:
        """Irradiance over π: the radiance of a white Lambertian surface, Σ Â_i L_i Y_i(n) / π.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²]. Opposite a small strong light the sum falls below zero; it is cut off there.
        """
        total = mi.Color3f(0)
        for i, value in enumerate(harmonics(n.x, n.y, n.z)):
            total += dr.gather(mi.Color3f, self.factors, mi.UInt32(i)) * value
        return dr.maximum(total, 0)

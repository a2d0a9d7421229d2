"""Irradiance from nine spherical-harmonic coefficients of the light."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.light.radiance import Light

Array = NDArray[np.float64]

CONVOLVED: Array = np.pi * np.array([1, 2 / 3, 2 / 3, 2 / 3, 1 / 4, 1 / 4, 1 / 4, 1 / 4, 1 / 4])
"""Factors Â_l of the clamped cosine for each coefficient: π, 2π/3, π/4; Ramamoorthi & Hanrahan (2001), eq. 8 and 9."""

_CONSTANTS = np.sqrt(np.array([1 / 4, 3 / 4, 3 / 4, 3 / 4, 15 / 4, 15 / 4, 5 / 16, 15 / 4, 15 / 16]) / np.pi)


def harmonics(d: Array) -> Array:
    """Real orthonormal harmonics of bands 0 to 2.

    Parameters
    ----------
    d : ndarray, shape (n, 3)
        Unit directions.

    Returns
    -------
    ndarray, shape (n, 9)
        1, y, z, x, xy, yz, 3z² − 1, xz, x² − y², each times its constant; Ramamoorthi & Hanrahan (2001), eq. 3.
    """
    x, y, z = d.T
    polynomials = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    return np.stack(polynomials, axis=1) * _CONSTANTS


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
    return np.asarray(harmonics(directions).T @ energies)


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
    terms : list of mi.Color3f
        Nine colours: coefficients times Â_l and the constant of the harmonic, over π (opaque).
    """

    terms: list[mi.Color3f]

    @classmethod
    def of(cls, coefficients: Array) -> HarmonicIrradiance:
        """Put coefficients of the light, shape (9, 3), on the device."""
        rows = coefficients * (CONVOLVED * _CONSTANTS / np.pi)[:, None]
        terms = [mi.Color3f(*row) for row in rows.tolist()]
        dr.make_opaque(terms)
        return cls(terms)

    def mean_radiance(self, n: mi.Vector3f) -> mi.Color3f:
        """Irradiance over π [W sr⁻¹ m⁻²] at unit normals: the radiance of a white Lambertian surface; never negative.

        Under the light of a sun, nine coefficients leave a part of the shadowed side below zero; it is cut off.
        """
        x, y, z = n.x, n.y, n.z
        polynomials = [mi.Float(1), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
        total = mi.Color3f(0)
        for term, value in zip(self.terms, polynomials, strict=True):
            total += term * value
        return dr.maximum(total, 0)

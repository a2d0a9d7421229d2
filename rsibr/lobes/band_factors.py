"""Band factors of the kernels that glossy reflections are filtered with, and the kernel nearest to another.

A kernel that is averaged over its places and turns multiplies the harmonics of band l by one factor Λ_l: the mean of
P_l(cos θ) over it. Kernels are compared at bands half an octave apart, each counting the same: light from natural
surroundings has about as much power in every octave (Dror, Willsky, Adelson 2004), so that the difference of the
factors is that of the pictures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

Array = NDArray[np.float64]

BANDS = np.unique(np.round(2 ** np.arange(0, 8.01, 0.5)).astype(int))
"""Bands at which kernels are compared, two an octave, up to features of 0.7°."""

_EXPONENTS = 2.0 ** np.arange(-1, 15.01, 0.125)


def phong(exponent: float | Array, bands: NDArray[np.integer] = BANDS) -> Array:
    """Factors of Phong's lobe max(cos θ, 0)^N, normalised to Λ_0 = 1.

    Parameters
    ----------
    exponent : float or ndarray, shape (K,)
        Exponent N > 0.
    bands : ndarray, shape (L,)
        Bands.

    Returns
    -------
    ndarray, shape (L,) or (K, L)

    Notes
    -----
    Λ_1 = (N+1)/(N+2), Λ_l = Λ_{l−2} (N+2−l)/(N+1+l).

    Examples
    --------
    >>> phong(10.0, np.array([0, 1, 2])).round(4).tolist()
    [1.0, 0.9167, 0.7692]
    """
    n = np.asarray(exponent, dtype=np.float64)[..., None]
    factors = [np.ones_like(n), (n + 1) / (n + 2)]
    for band in range(2, int(np.max(bands)) + 1):
        factors.append(factors[band - 2] * (n + 2 - band) / (n + 1 + band))
    return np.asarray(np.concatenate([factors[band] for band in bands], axis=-1))


def gaussian(width: float | Array, bands: NDArray[np.integer] = BANDS) -> Array:
    """Factors exp(−l(l+1) σ²/2) of a Gaussian on the sphere (heat kernel).

    Parameters
    ----------
    width : float or ndarray, shape (...,)
        Standard deviation σ [rad] along one axis.
    bands : ndarray, shape (L,)
        Bands.

    Returns
    -------
    ndarray, shape (..., L)
    """
    return np.asarray(np.exp(-0.5 * bands * (bands + 1) * np.square(np.asarray(width))[..., None]))


def ggx(alpha: float, bands: NDArray[np.integer] = BANDS, points: int = 2048) -> Array:
    """Factors of the mirrored directions around a GGX lobe of roughness α at normal incidence, shape (L,).

    Notes
    -----
    Normals with density D cos θ_h (Walter et al. 2007, eq. 35); what would reflect below the horizon is left out.
    """
    u = (np.arange(points) + 0.5) / points
    cosine = np.cos(2 * np.arctan(alpha * np.sqrt(u / (1 - u))))
    return np.asarray(eval_legendre(bands[:, None], cosine[cosine > 0]).mean(axis=1))


def exponent_for(factors: Array) -> tuple[float, float]:
    """Phong exponent whose lobe has the factors nearest to those of a kernel.

    Parameters
    ----------
    factors : ndarray, shape (len(BANDS),)
        Band factors of the kernel at `BANDS`.

    Returns
    -------
    exponent : float
        N, from 0.5 to 32 768.
    error : float
        See `distance`.

    Examples
    --------
    >>> round(exponent_for(phong(100.0))[0])
    100
    """
    lobes = phong(_EXPONENTS)
    errors = np.square(lobes - factors).sum(axis=1)
    best = int(np.clip(np.argmin(errors), 1, len(_EXPONENTS) - 2))
    below, at, above = errors[best - 1 : best + 2]
    bend = below - 2 * at + above  # vertex of the parabola through the three
    shift = float(np.clip((below - above) / (2 * bend), -1, 1)) if bend > 0 else 0.0
    exponent = float(_EXPONENTS[best] * 2 ** (0.125 * shift))
    return exponent, distance(phong(exponent), factors)


def distance(found: Array, wanted: Array) -> float:
    """Root mean square difference of band factors over that of `wanted`.

    It is the relative error of the contrast that a picture of the filtered light has.
    """
    return float(np.linalg.norm(found - wanted) / max(float(np.linalg.norm(wanted)), 1e-30))

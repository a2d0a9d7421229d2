"""Band factors of the kernels that glossy reflections are filtered with, and the kernel nearest to another.

A kernel that is averaged over its places and turns multiplies the harmonics of band l by one factor Λ_l: the mean of
P_l(cos θ) over it. Kernels are compared at bands half an octave apart, each counting the same: light from natural
surroundings has about as much power in every octave (Dror, Willsky, Adelson 2004), so that the difference of the
factors is that of the pictures.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

Array = NDArray[np.float64]

BANDS = np.unique(np.round(2 ** np.arange(0, 8.01, 0.5)).astype(int))
"""Bands at which kernels are compared, two an octave, up to features of 0.7°."""

_EXPONENTS = 2.0 ** np.arange(-1, 15.01, 0.125)
_STRATA = 4  # places a side of a quarter of a face
_QUANTILES = 16  # points a side of a box kernel
_LEVELS = 12


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


def box(size: int, bias: float, bands: NDArray[np.integer] = BANDS) -> Array:
    """Factors of a trilinear lookup in a box-filtered cube, averaged over all directions, shape (L,).

    Parameters
    ----------
    size : int
        Texels a side of the finest level, a power of two.
    bias : float
        Level of detail, 0 for the finest level.

    Notes
    -----
    Averaged over the places in a texel, a bilinear lookup of box-filtered texels of width w is the convolution of three
    boxes of width w on the face. The level of one texel a face is not described by that and is the last one here.
    """
    level = int(np.clip(np.floor(bias), 0, max(np.log2(size) - 1, 0)))
    share = float(np.clip(bias - level, 0, 1))
    first = int(np.log2(size)) - level
    return (1 - share) * _box_level(first, tuple(bands)) + share * _box_level(max(first - 1, 0), tuple(bands))


def bias_for(factors: Array, size: int) -> tuple[float, float]:
    """Bias whose box-filtered cube has the factors nearest to those at `BANDS`, and the error.

    Parameters
    ----------
    factors : ndarray, shape (len(BANDS),)
        Band factors of the wanted kernel.
    size : int
        Texels a side of the finest level, a power of two.

    Returns
    -------
    bias : float
        In [0, log₂ size].
    error : float
        See `distance`.

    Examples
    --------
    >>> bias, error = bias_for(phong(225.0), 64)
    >>> 1.8 < bias < 2.6
    True
    """
    count = int(np.log2(size))
    levels = np.stack([_box_level(count - level, tuple(BANDS)) for level in range(count + 1)])
    if count == 0:
        return 0.0, distance(levels[0], factors)
    step = np.diff(levels, axis=0)
    share = ((factors - levels[:-1]) * step).sum(axis=1) / np.square(step).sum(axis=1)
    share = np.clip(share, 0, 1)
    errors = np.square(levels[:-1] + share[:, None] * step - factors).sum(axis=1)
    best = int(np.argmin(errors))
    return best + float(share[best]), distance(levels[best] + share[best] * step[best], factors)


def exponent_for(factors: Array) -> tuple[float, float]:
    """Phong exponent N whose lobe has the factors nearest to those at `BANDS`, and the error; see `bias_for`."""
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


@lru_cache(maxsize=64)
def _box_level(level: int, bands: tuple[int, ...]) -> Array:
    """Factors of the level of 2^`level` texels a side, by quadrature over places of a quarter face and the kernel."""
    width = 2.0 ** (1 - level)  # of a texel, on the face [−1, 1]²
    middle = (np.arange(_STRATA) + 0.5) / _STRATA
    x, y = (place.ravel()[:, None, None] for place in np.meshgrid(middle, middle))
    offset = width * _three_boxes()
    shifted_x, shifted_y = x + offset[:, None], y + offset[None, :]
    norm = np.sqrt((1 + x * x + y * y) * (1 + shifted_x**2 + shifted_y**2))
    cosine = (1 + x * shifted_x + y * shifted_y) / norm
    weight = (1 + x * x + y * y).ravel() ** -1.5  # solid angle of a place
    mean = np.stack([eval_legendre(band, cosine).mean(axis=(1, 2)) for band in bands])
    return np.asarray(mean @ weight / weight.sum())


def _three_boxes() -> Array:
    """Quantiles of the sum of three uniform variables on [−½, ½], shape (_QUANTILES,), scaled to its variance ¼."""
    x = np.linspace(-1.5, 1.5, 3001)
    density = np.where(np.abs(x) < 0.5, 0.75 - x * x, 0.5 * (1.5 - np.abs(x)) ** 2)
    total = np.cumsum(density)
    points = np.interp((np.arange(_QUANTILES) + 0.5) / _QUANTILES, total / total[-1], x)
    return np.asarray(points * (0.5 / points.std()))

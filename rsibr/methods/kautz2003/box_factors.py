"""Band factors of the kernel of a box-filtered cube, and the bias whose kernel is nearest to another."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

from rsibr.lobes.band_factors import BANDS, distance

Array = NDArray[np.float64]

_STRATA = 4  # places a side of a quarter of a face
_QUANTILES = 16  # points a side of a box kernel


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
    >>> from rsibr.lobes.band_factors import phong
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

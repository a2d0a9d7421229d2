"""Filling of what no photograph saw, from what lies around it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def filled(image: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fill the texels of weight 0 smoothly.

    Parameters
    ----------
    image : ndarray, shape (H, W, 3)
        Latitude–longitude map; ignored where the weight is 0.
    weight : ndarray, shape (H, W)
        At least one is positive.

    Returns
    -------
    ndarray, shape (H, W, 3)
        The image where the weight is positive; elsewhere weighted means over growing neighbourhoods.

    Notes
    -----
    Push and pull over a pyramid of halved images (Gortler et al. 1996, section 3.4.1); the longitude is periodic.
    """
    if (weight > 0).all():
        return image
    smaller = _halved(image * weight[..., None]), _halved(weight[..., None])
    total = np.maximum(smaller[1], 1e-300)
    coarse = smaller[0] / total
    if max(coarse.shape[:2]) > 1:
        coarse = filled(coarse, np.minimum(smaller[1][..., 0], 1.0))
    return np.where(weight[..., None] > 0, image, _doubled(coarse, image.shape[0], image.shape[1]))


def _halved(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over 2 × 2 texels; an odd last row or column stands alone."""
    height, width = image.shape[:2]
    even = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)))
    return np.asarray(even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2])


def _doubled(image: NDArray[np.float64], height: int, width: int) -> NDArray[np.float64]:
    """Bilinear interpolation at twice the resolution, around the longitude."""
    rows = np.clip((np.arange(height) + 0.5) / 2 - 0.5, 0, image.shape[0] - 1)
    columns = (np.arange(width) + 0.5) / 2 - 0.5
    top, left = rows.astype(int), np.floor(columns).astype(int)
    bottom = np.minimum(top + 1, image.shape[0] - 1)
    down, across = (rows - top)[:, None, None], (columns - left)[None, :, None]
    left, right = left % image.shape[1], (left + 1) % image.shape[1]
    upper = (1 - across) * image[top][:, left] + across * image[top][:, right]
    lower = (1 - across) * image[bottom][:, left] + across * image[bottom][:, right]
    return np.asarray((1 - down) * upper + down * lower)

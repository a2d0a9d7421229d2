"""Small pictures of radiance: their size for a number of jobs, and the averaging."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOST_PICTURES = 2000
"""Maximum number of jobs with a picture in one page."""

_SIDES = ((200, 192), (600, 96), (MOST_PICTURES, 64))
"""Texels a side up to a number of jobs: a page has a few MiB at most, whatever the number."""


def thumbnail_side(jobs: int) -> int:
    """Texels a side of the pictures in a gallery of so many jobs.

    Examples
    --------
    >>> thumbnail_side(12), thumbnail_side(500), thumbnail_side(100_000)
    (192, 96, 64)
    """
    return next((side for most, side in _SIDES if jobs <= most), _SIDES[-1][1])


def thumbnail(radiance: NDArray[np.floating], jobs: int = 1) -> NDArray[np.float32]:
    """Average blocks of texels, so that a gallery of many jobs fits in memory.

    Parameters
    ----------
    radiance : ndarray, shape (H, W, 3)
        Linear radiance [W sr⁻¹ m⁻²].
    jobs : int
        Number of jobs in the gallery.

    Returns
    -------
    ndarray, shape (h, w, 3), float32
        No side exceeds `thumbnail_side(jobs)`; a smaller picture is unchanged. NaN and Inf count as 0.
    """
    finite = np.where(np.isfinite(radiance), radiance, 0).astype(np.float32)
    block = -(-max(finite.shape[:2]) // thumbnail_side(jobs))
    height, width = (-(-side // block) * block for side in finite.shape[:2])
    padded = np.pad(finite, ((0, height - finite.shape[0]), (0, width - finite.shape[1]), (0, 0)), mode="edge")
    blocks = padded.reshape(height // block, block, width // block, block, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64), dtype=np.float32)

"""Radiance as an 8-bit sRGB image in a PNG file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.store.atomic import write_atomic

Rgba = NDArray[np.uint8]

_BRIGHT_PERCENTILE = 95.0
_BRIGHT = 0.8


def exposure_of(brightest: NDArray[np.floating]) -> float:
    """Exposure, a factor on radiance, at which an image is neither dark nor washed out.

    Parameters
    ----------
    brightest : ndarray, shape (n,)
        Maximum channel of each pixel that counts; what is not finite is left out.

    Returns
    -------
    float
        Maps the 95th percentile to 0.8; 1 if that is black, or nothing counts.
    """
    finite = brightest[np.isfinite(brightest)]
    bright = float(np.percentile(finite, _BRIGHT_PERCENTILE)) if finite.size else 0.0
    return _BRIGHT / bright if bright > 0 else 1.0


def tone_mapped(image: NDArray[np.floating], coverage: NDArray[np.floating], exposure: float) -> Rgba:
    """Convert radiance to sRGB: fixed exposure, clipping, transfer function.

    Parameters
    ----------
    image : ndarray, shape (H, W, 3)
        Scene-linear Rec.709; ignored where coverage is 0.
    coverage : ndarray, shape (H, W)
        Opacity of the result.
    exposure : float
        Factor on radiance; the same for all images to be compared.

    Returns
    -------
    ndarray, shape (H, W, 4), uint8
    """
    linear = np.clip(np.where(coverage[..., None] > 0, image, 0.0) * exposure, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
    return to_bytes(np.concatenate([encoded, np.clip(coverage, 0, 1)[..., None]], axis=-1))


def to_bytes(values: NDArray[np.floating]) -> Rgba:
    """Round numbers in [0, 1] to bytes; NaN is 0."""
    return np.asarray(np.rint(np.clip(np.nan_to_num(values), 0.0, 1.0) * 255), dtype=np.uint8)


def encode_png(picture: Rgba) -> bytes:
    """Encode an image of shape (H, W, 4) as PNG."""
    from matplotlib.image import imsave  # noqa: PLC0415  # a quarter of a second that only those pay who need it

    stream = io.BytesIO()
    imsave(stream, picture, format="png")
    return stream.getvalue()


def write_png(path: Path, picture: Rgba) -> None:
    """Write an image of shape (H, W, 4), uint8, as PNG, atomically."""
    write_atomic(path, encode_png(picture))

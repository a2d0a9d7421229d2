"""Radiance files (`.hdr`): RGBE with run lengths."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.publishing.published_view import MAKER

_MANTISSA = 8
LARGEST = 1e37
"""Largest value that is written; the exponent of the format ends at 1.7e38."""


def _step(largest: NDArray[np.float32]) -> NDArray[np.float32]:
    """Step of the mantissa of pixels whose largest channel is given."""
    return np.asarray(np.ldexp(np.float32(1), np.frexp(largest)[1] - _MANTISSA))


def encode_radiance(image: NDArray[np.float32], about: str) -> tuple[bytes, tuple[str, ...]]:
    """Encode radiance of shape (H, W, 3); error at most 0.4 % of the largest channel of each pixel.

    Returns
    -------
    data : bytes
    notes : tuple of str
        Negative values, which the format cannot hold and which become 0, and values beyond `LARGEST`.
    """
    negative, beyond = int((image < 0).sum()), int((image > LARGEST).sum())
    notes = [f"{negative} of {image.size} values below 0 clipped, down to {image.min():.3g}"] if negative else []
    notes += [f"{beyond} of {image.size} values beyond {LARGEST:g} clamped, up to {image.max():.3g}"] if beyond else []
    values = np.clip(image, 0, LARGEST)
    # Mitsuba cuts mantissas off: half a step more rounds them, as readers that add nothing expect
    largest = values.max(axis=-1, keepdims=True)
    step = _step(largest + _step(largest) / 2)  # that of the exponent after rounding
    rounded_image = np.ascontiguousarray(np.where(largest > 0, values + step / 2, 0), np.float32)
    bitmap = mi.Bitmap(rounded_image)
    bitmap.metadata()["comments"] = f"{about} {MAKER}"
    stream = mi.MemoryStream()
    bitmap.write(stream, mi.Bitmap.FileFormat.RGBE)
    return bytes(stream.raw_buffer()), tuple(notes)

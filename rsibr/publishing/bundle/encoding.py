"""Encoding of arrays for the page: half or single precision, prediction of images, bytes apart, gzip, base64."""

from __future__ import annotations

import base64
import gzip
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Precision = Literal["half", "float"]
"""Numbers of radiance maps: 16 bits, or 32."""

LARGEST_HALF = 65504.0
"""Largest finite number of 16 bits. Brighter images are stored as multiples of a power of two."""

MANTISSA = 10
"""Bits of a half number's mantissa."""

_TYPES = {"float16": "half", "float32": "float", "int16": "short", "uint32": "uint"}


@dataclass(frozen=True, eq=False)
class Encoded:
    """One array as it stands in a bundle.

    Attributes
    ----------
    type : str
        "half", "float", "short" or "uint".
    shape : tuple of int
        Shape, in C order.
    scale : float
        Factor on the numbers, a power of two.
    is_image : bool
        Whether the numbers are what `predicted` leaves of images of shape (…, 3, H, W).
    data : bytes
        Gzip of the lowest bytes of all numbers, then of their second bytes, and so on.
    """

    type: str
    shape: tuple[int, ...]
    scale: float
    is_image: bool
    data: bytes

    def to_json(self) -> dict[str, Any]:
        """Return the array as a bundle's JSON holds it."""
        text = base64.b64encode(self.data).decode("ascii")
        return {
            "type": self.type,
            "shape": list(self.shape),
            "scale": self.scale,
            "image": self.is_image,
            "data": text,
        }


def encoded(values: NDArray[Any]) -> Encoded:
    """Encode an array of one of the types float16, float32, int16 and uint32.

    Examples
    --------
    >>> one = encoded(np.ones((2, 3), np.float32))
    >>> one.type, one.shape, gzip.decompress(one.data)[-6:].hex()
    ('float', (2, 3), '3f3f3f3f3f3f')
    """
    return Encoded(_TYPES[values.dtype.name], tuple(values.shape), 1.0, False, _planes(values))


def encoded_images(values: NDArray[np.floating[Any]], precision: Precision, mantissa: int = MANTISSA) -> Encoded:
    """Encode images of radiance.

    Parameters
    ----------
    values : ndarray, shape (…, H, W, 3)
        Finite radiance [W sr⁻¹ m⁻²]; a bundle holds the channels as planes, (…, 3, H, W).
    precision : {"half", "float"}
        Numbers to store. Half numbers are scaled by a power of two where they would overflow.
    mantissa : int
        Bits of a half number's mantissa that are kept, at most `MANTISSA`.
    """
    planes = np.ascontiguousarray(np.moveaxis(values, -1, -3))
    if precision == "float":
        return encoded(np.asarray(planes, np.float32))
    largest = float(np.abs(planes).max(initial=0.0))
    scale = 2.0 ** max(0, math.ceil(math.log2(largest / LARGEST_HALF))) if largest > 0 else 1.0
    half = rounded((planes.astype(np.float64) / scale).astype(np.float16), mantissa)
    return Encoded("half", tuple(half.shape), scale, True, _planes(predicted(half.view(np.uint16))))


def rounded(half: NDArray[np.float16], mantissa: int) -> NDArray[np.float16]:
    """Round half numbers to fewer bits of mantissa, ties to even; one that would become infinite is cut off instead.

    Examples
    --------
    >>> rounded(np.float16([1.001, 3.3]), 2).tolist()
    [1.0, 3.5]
    """
    dropped = MANTISSA - mantissa
    if not dropped:
        return half
    bits = half.view(np.uint16).astype(np.uint32)
    up = ((bits + (1 << (dropped - 1)) - 1 + ((bits >> dropped) & 1)) >> dropped) << dropped
    is_finite = (up & 0x7C00) != 0x7C00
    return np.where(is_finite, up, bits >> dropped << dropped).astype(np.uint16).view(np.float16)


def predicted(planes: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Leave of images what their neighbours and their green channel do not tell.

    Parameters
    ----------
    planes : ndarray, shape (…, 3, H, W)
        Bit patterns of the three channels.

    Returns
    -------
    ndarray of uint16, same shape
        Red and blue less green, then each number less the median of left, upper, and left + upper − upper left: the
        predictor of JPEG-LS (Weinberger, Seroussi, Sapiro 2000). All modulo 2¹⁶; the sign goes into the lowest bit.
    """
    apart = planes.copy()
    apart[..., 0, :, :] -= planes[..., 1, :, :]
    apart[..., 2, :, :] -= planes[..., 1, :, :]
    number = apart.astype(np.int64)
    left, upper, corner = (np.zeros_like(number) for _ in range(3))
    left[..., 1:] = number[..., :-1]
    upper[..., 1:, :] = number[..., :-1, :]
    corner[..., 1:, 1:] = number[..., :-1, :-1]
    low, high = np.minimum(left, upper), np.maximum(left, upper)
    guess = np.where(corner >= high, low, np.where(corner <= low, high, left + upper - corner))
    rest = ((number - guess) & 0xFFFF).astype(np.uint16).view(np.int16)
    return ((rest << 1) ^ (rest >> 15)).view(np.uint16)


def _planes(values: NDArray[Any]) -> bytes:
    flat = np.ascontiguousarray(values).reshape(-1)
    little = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
    return gzip.compress(little.view(np.uint8).reshape(len(flat), -1).T.tobytes(), 9, mtime=0)

"""Shared-exponent texels of eight bytes: three signed mantissas of 18 bits and one exponent.

Lookups of warped maps are bound by memory; eight bytes take two thirds of the time of float32 RGBA. The exponent is
that of the texel's greatest channel and covers 1e-33 to the largest float32, so that a sun of 1e6 and a sky of 1e-2 are
both kept. Half floats end at 65504 and have a relative error of 5e-4. The sign is needed for residuals.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell

MANTISSA_BITS = 17
"""Bits of a mantissa, without the sign."""

PRECISION = 2.0**-MANTISSA_BITS
"""Largest error of a channel, relative to the greatest channel of its texel: 7.6e-6."""

_BIAS = 127  # of the exponent of a float32
_LEAST_EXPONENT = 1 - _BIAS + MANTISSA_BITS
_NOT_FINITE = 255
_MANTISSA = np.uint32(2 ** (MANTISSA_BITS + 1) - 1)
_LARGEST = np.float32(np.ldexp(1 - 2 * PRECISION, 128))  # the largest float32 would round up to infinity


def packed(radiance: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Encode radiance; `unpacked` decodes it.

    Parameters
    ----------
    radiance : ndarray, shape (..., 3)
        Radiance [W sr⁻¹ m⁻²], or a residual of it.

    Returns
    -------
    ndarray, shape (..., 2)
        Two words a texel, from the highest bit: 18 bits of red, the upper 14 of blue; the lower 4 of blue, 18 of green,
        a zero, 8 of the exponent, a zero. A texel that is not finite decodes to NaN.
    """
    finite = np.logical_and.reduce([np.isfinite(channel) for channel in np.moveaxis(radiance, -1, 0)])
    light = np.where(finite[..., None], np.clip(radiance, -_LARGEST, _LARGEST), np.float32(0))
    # One step more, so that a channel that rounds up to the next power of two gets the exponent of that
    largest = np.maximum.reduce([np.abs(channel) for channel in np.moveaxis(light, -1, 0)])  # ten times max(axis=-1)
    exponent = np.frexp(largest.astype(np.float64) * (1 + PRECISION))[1]
    exponent = np.maximum(exponent, _LEAST_EXPONENT)
    mantissas = np.rint(np.ldexp(light, (MANTISSA_BITS - exponent)[..., None])).astype(np.int32)
    biased = np.where(finite, exponent - MANTISSA_BITS + _BIAS, _NOT_FINITE).astype(np.uint32)
    red, green, blue = np.moveaxis(mantissas.view(np.uint32) & _MANTISSA, -1, 0)
    return np.stack([red << 14 | blue >> 4, blue << 28 | green << 10 | biased << 1], axis=-1)


def unpacked(words: mi.Vector2u) -> tuple[mi.Color3f, mi.Float]:
    """Decode texels: (mantissas, scale), whose product is the radiance.

    The two stay separate so that an interpolation multiplies its weight by the scale once, not three times.
    """
    # Shift each mantissa to the top of a signed word, then arithmetically down to extend the sign
    tops = words.x, words.y << 4, (words.x << 18) | (words.y >> 14)
    scale = dr.reinterpret_array(mi.Float, words.y << 22)  # the exponent's position in a float32
    return mi.Color3f(*(mi.Float(mi.Int32(top) >> 14) for top in tops)), scale


def bilinear(
    texels: mi.Float, cell: BilinearCell, left: mi.UInt32, right: mi.UInt32, below: mi.UInt32 | int
) -> mi.Color3f:
    """Interpolate between four packed texels.

    Parameters
    ----------
    texels : mi.Float
        Two words a texel, flat.
    cell : BilinearCell
        Where the point lies between the four.
    left, right : mi.UInt32
        Indices of the upper two.
    below : mi.UInt32 or int
        Difference from their indices to those of the lower two.

    Returns
    -------
    mi.Color3f
        Radiance [W sr⁻¹ m⁻²].
    """

    def fetch(index: mi.UInt32) -> tuple[mi.Color3f, mi.Float]:
        # Gathered as floats, of which LLVM loads two at once, and as the words that they are again
        return unpacked(dr.reinterpret_array(mi.Vector2u, dr.gather(mi.Vector2f, texels, index)))

    def between(left: mi.UInt32, right: mi.UInt32) -> mi.Color3f:
        (one, one_scale), (other, other_scale) = fetch(left), fetch(right)
        return one * ((1 - cell.rightward) * one_scale) + other * (cell.rightward * other_scale)

    return dr.lerp(between(left, right), between(left + below, right + below), cell.downward)

"""Light of a bake: its octahedral image, from which the page blurs the environment pyramid and draws the background."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.light.environment_pyramid import added_blur, blur_taps, level_resolution, level_widths
from rsibr.publishing.bundle.contents import Part, Request, contributes
from rsibr.publishing.bundle.encoding import encoded, encoded_images

MANTISSA = 7
"""Bits of the mantissa of the light's half numbers: a lookup averages over many texels, and rounding does not bias."""


@contributes("light")
def light(request: Request) -> Part:
    """Octahedral image of the radiance, reduced to the size that is asked for."""
    bake = request.methods.inputs.bake
    if bake.manifest.light is None:
        return Part()
    picture = bake.light.picture
    image = reduced(picture, request.light_size or len(picture))
    widths = level_widths(len(image))
    sides = [len(image), *(level_resolution(len(image), width) for width in widths[1:])]
    blurs = [0.0, *(added_blur(len(image), before, after) for before, after in pairwise(widths))]
    arrays = {"picture": encoded_images(image, request.precision, MANTISSA), "taps": encoded(_taps())}
    return Part({"widths": widths, "sides": sides, "blurs": blurs}, arrays)


def _taps() -> NDArray[np.float32]:
    """Places and weights of the taps of a blur of standard deviation 1, shape (taps, 3)."""
    return blur_taps(1.0)[:, :3].astype(np.float32)


def reduced(picture: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Means over squares of an image's texels, shape (size, size, 3).

    Raises
    ------
    InputError
        If `size` does not divide the texels a side.
    """
    if size < 1 or len(picture) % size:
        fix = f"give a size that divides {len(picture)}"
        raise InputError(f"{size} texels a side of the light", where="light_size", fix=fix)
    side = len(picture) // size
    return np.asarray(picture.reshape(size, side, size, side, 3).mean(axis=(1, 3)), dtype=np.float32)

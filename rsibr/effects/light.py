"""The distant light as one octahedral picture: what the model of a lobe is blurred from."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.effects.wavelengths import Wavelengths
from rsibr.geometry.octahedral import texel_directions

RESOLUTION = 512
"""Texels a side: 0.4° each, as fine as an environment map of 1024 × 512."""

DELTA_RESOLUTION = 1024
"""Texels a side for a material with a delta lobe, which blurs nothing."""

_WAVELENGTHS = 64
"""Points of the sum over wavelengths, four wavelengths each: 2 nm apart."""

_POINTS = 3  # a side and texel at least, and so many a side and texel of the environment's
_MOST_POINTS = 24


def light_map(emitter: dict[str, Any], width: int = 0, resolution: int = RESOLUTION) -> NDArray[np.float32]:
    """Mean radiance of the light over each texel.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity.
    width : int
        Columns of its image, if it has one: finer images are looked up at more points.
    resolution : int
        Texels a side, R.

    Returns
    -------
    ndarray, shape (R, R, 3), float32
        Radiance [W sr⁻¹ m⁻²]; see `rsibr.geometry.octahedral`. Black where the emitter is no environment, such as
        `directional`.
    """
    environment = mi.load_dict({"type": "scene", "light": emitter}).environment()
    if environment is None:
        return np.zeros((resolution, resolution, 3), dtype=np.float32)
    finer = math.ceil(_POINTS * width / (math.sqrt(math.pi) * resolution))  # a texel's angle over 2π/width
    points = min(max(_POINTS, finer), _MOST_POINTS)
    total = dr.zeros(mi.Color3f, resolution**2)  # a constant emitter answers for all lanes at once
    offsets = (np.arange(points) + 0.5) / points
    for right in offsets:
        for down in offsets:  # a pass a point, lest a fine environment fills the memory
            total += _radiance(environment, texel_directions(resolution, float(right), float(down)))
            dr.eval(total)
    return np.array(total / points**2, dtype=np.float32).T.reshape(resolution, resolution, 3)


def _radiance(environment: mi.Emitter, d: mi.Vector3f) -> mi.Color3f:
    """Light from the direction `d`; in spectral rendering as an observer sees it, summed over wavelengths."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(d))
    si.wi = -d
    if not mi.is_spectral:
        return environment.eval(si)

    def seen(place: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
        wavelengths = Wavelengths.at((mi.Float(place) + 0.5) / _WAVELENGTHS)
        si.wavelengths = wavelengths.nm
        radiance = mi.unpolarized_spectrum(environment.eval(si)) * wavelengths.weight
        return place + 1, total + wavelengths.seen(radiance)

    state = mi.UInt32(0), dr.zeros(mi.Color3f)
    _, total = dr.while_loop(state, lambda place, _total: place < _WAVELENGTHS, seen, label="wavelengths")
    return total / _WAVELENGTHS

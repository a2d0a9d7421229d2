"""Maps of a picture: reconstructed, filtered into MIP levels inside the disk, filled beyond it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.geometry.to_device import to_device
from rsibr.methods.protocol import Method
from rsibr.methods.warp_blend.source_maps import filled_outward
from rsibr.shading.maps.view_maps import BORDER, ViewMaps

RESOLUTION = 256
"""Texels a side of a reconstructed map by default."""

_LEAST, _MOST = 4, 4096


@dataclass(eq=False)
class Level:
    """What does not depend on the radiance of one level of the maps, on the device.

    Attributes
    ----------
    side : int
        Texels a side.
    coverage : mi.Float
        Share of each texel inside the disk.
    nearest : mi.UInt32
        For each texel with the border, the nearest texel that touches the disk.
    shown : mi.Float
        Coverage of each texel with the border.
    """

    side: int
    coverage: mi.Float
    nearest: mi.UInt32
    shown: mi.Float

    @classmethod
    def of(cls, side: int) -> Level:
        """Make the tables of a level."""
        coverage = stored_coverage(side)
        padded = np.pad(coverage, BORDER)
        numbers = np.pad(np.arange(side * side, dtype=np.uint32).reshape(side, side), BORDER)
        nearest = filled_outward(numbers, padded > 0)
        return cls(side, to_device(mi.Float, coverage), to_device(mi.UInt32, nearest), to_device(mi.Float, padded))


@cache
def levels_of(resolution: int, variant: str) -> tuple[Level, ...]:  # noqa: ARG001  # arrays belong to a variant
    """All levels of maps of `resolution` texels a side, down to one texel."""
    return tuple(Level.of(resolution >> k) for k in range(resolution.bit_length()))


@dataclass(eq=False)
class MapMaker:
    """Maker of the maps of a picture.

    Attributes
    ----------
    method : Method
        Method of the bake.
    resolution : int
        Texels a side of level 0, a power of two.
    has_levels : bool
        Whether to make MIP levels.

    Notes
    -----
    A texel of a level is the mean of the four below it, weighted by their area inside the disk. Radiance beyond the rim
    has no weight, and the rim does not bleed. In a sphere map equal areas of the disk are equal solid angles of mirror
    directions: dω_n = dA/z for normals at the depth z, and dω_r = 4z dω_n.
    """

    method: Method
    resolution: int = RESOLUTION
    has_levels: bool = False

    def __post_init__(self) -> None:
        n = self.resolution
        if not (_LEAST <= n <= _MOST and n & (n - 1) == 0):
            fix = f"give a power of two, {_LEAST} to {_MOST}"
            raise InputError(f"maps of {n} texels a side", where="resolution", fix=fix)

    def maps(self, frames: Sequence[NDArray[np.float64]]) -> ViewMaps:
        """Reconstruct the maps of some views.

        Parameters
        ----------
        frames : sequence of ndarray, shape (3, 3)
            Columns x, y, z in world coordinates; z is the view direction.
        """
        levels = levels_of(self.resolution, mi.variant())[: None if self.has_levels else 1]
        sizes = [(level.side + 2 * BORDER) ** 2 for level in levels]
        first = np.concatenate([[0], np.cumsum(sizes)])
        count, map_size = len(frames), dr.opaque(mi.UInt32, int(first[-1]))
        texels = dr.empty(mi.Float, 4 * count * int(first[-1]))
        image = self._reconstructed(frames)
        for number, level in enumerate(levels):
            if number:
                image = _halved(image, levels[number - 1], count)
            _fill(texels, image, level, count, dr.opaque(mi.UInt32, int(first[number])), map_size)
        dr.eval(texels)
        columns = np.stack([frame.T for frame in frames]).astype(np.float32)
        return ViewMaps(
            texels=texels,
            frames=to_device(mi.Float, columns),
            first=to_device(mi.UInt32, first[:-1].astype(np.uint32)),
            map_size=map_size,
            half=dr.opaque(mi.Float, self.resolution / 2),
            last=dr.opaque(mi.UInt32, len(levels) - 1),
        )

    def _reconstructed(self, frames: Sequence[NDArray[np.float64]]) -> mi.Float:
        """Texels of all maps at level 0, without border, RGBA, flat."""
        if len(frames) == 1:
            return self.method.map(frames[0], self.resolution).array
        size = self.resolution**2
        image = dr.empty(mi.Float, 4 * size * len(frames))
        texel = dr.arange(mi.UInt32, size)
        for k, frame in enumerate(frames):
            made = self.method.map(frame, self.resolution).array
            dr.scatter(image, dr.gather(mi.Vector4f, made, texel), texel + dr.opaque(mi.UInt32, k * size))
            dr.eval(image)
        return image


def _halved(image: mi.Float, fine: Level, count: int) -> mi.Float:
    """Texels of the next level of all maps, from those of the level `fine`."""
    side = fine.side // 2
    wide, size = dr.opaque(mi.UInt32, fine.side), dr.opaque(mi.UInt32, side * side)
    lane = dr.arange(mi.UInt32, count * side * side)
    number, texel = lane // size, lane % size
    narrow = wide // 2
    corner = 2 * (texel // narrow) * wide + 2 * (texel % narrow)
    total, weights = mi.Vector4f(0), mi.Float(0)
    for offset in (0, 1, wide, wide + 1):
        weight = dr.gather(mi.Float, fine.coverage, corner + offset)
        seen = dr.gather(mi.Vector4f, image, number * size * 4 + corner + offset)
        total += dr.select(weight > 0, weight * seen, 0)
        weights += weight
    mean = total * dr.rcp(dr.maximum(weights, 1e-20))
    halved = dr.empty(mi.Float, 4 * dr.width(lane))
    dr.scatter(halved, mean, lane)
    dr.eval(halved)
    return halved


def _fill(texels: mi.Float, image: mi.Float, level: Level, count: int, first: mi.UInt32, map_size: mi.UInt32) -> None:
    """Write one level of all maps with its border, values beyond the disk taken from the nearest texel inside."""
    bordered = (level.side + 2 * BORDER) ** 2
    lane = dr.arange(mi.UInt32, count * bordered)
    size, inner = dr.opaque(mi.UInt32, bordered), dr.opaque(mi.UInt32, level.side**2)
    number, place = lane // size, lane % size
    source = number * inner + dr.gather(mi.UInt32, level.nearest, place)
    seen = dr.gather(mi.Vector4f, image, source)
    seen.w = dr.gather(mi.Float, level.shown, place)
    dr.scatter(texels, seen, number * map_size + first + place)
    dr.eval(texels)

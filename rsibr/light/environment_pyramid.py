"""Gaussian pyramid of the environment: radiance at increasing blur, on the device.

Each level is an octahedral image with a resolution of its own. The width of a level is that of a bilinear lookup in it:
the variances of its Gaussian and of the lookup's tent filter, added.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.frame import frame_of
from rsibr.geometry.projections.octahedral import bordered, square_from_direction, texel_directions
from rsibr.geometry.to_device import to_device
from rsibr.light.shared_exponent import bilinear, packed

WIDEST = 1.3
"""Standard deviation [rad] of the coarsest level; wider levels would be nearly constant."""

_FINENESS = 2.2  # texels per standard deviation
_LEAST_RESOLUTION = 8
_REMEMBERED = 4  # environments whose levels are kept: 16 MB each for pictures of 512²
_REACH, _TAPS = 2.8, 9  # of a blur: cut-off in standard deviations; taps a side

_remembered: dict[bytes, list[NDArray[np.float32]]] = {}


@dataclass(eq=False)
class EnvironmentPyramid:
    """Radiance of the environment at widths √2 apart, except between the first two levels.

    Attributes
    ----------
    texels : mi.Float
        Texels of all levels, each level with a border of one texel, flat; two words a texel as bits of floats, see
        `rsibr.light.shared_exponent`.
    starts, resolutions : mi.UInt32
        Offset of each level in texels, and its texels a side.
    variances : mi.Float
        Variance [rad²] of each level.
    finest : mi.Float
        Standard deviation [rad] of level 1 (opaque); level 0 is the unblurred environment.
    last : mi.Float
        Index of the last level (opaque).

    Examples
    --------
    >>> pyramid = EnvironmentPyramid.of(np.full((16, 16, 3), 2.0, dtype=np.float32))
    >>> bool(dr.allclose(pyramid.blurred(mi.Vector3f(0, 1, 0), mi.Float(0.2)), 2, rtol=1e-4))
    True
    """

    texels: mi.Float
    starts: mi.UInt32
    resolutions: mi.UInt32
    variances: mi.Float
    finest: mi.Float
    last: mi.Float

    @classmethod
    def of(cls, picture: NDArray[np.float32], levels: Sequence[NDArray[np.float32]] = ()) -> EnvironmentPyramid:
        """Copy the pyramid of an environment to the device.

        Parameters
        ----------
        picture : ndarray, shape (R, R, 3)
            Octahedral image of the radiance [W sr⁻¹ m⁻²], level 0; see `rsibr.light.radiance.light_map`.
        levels : sequence of ndarray
            Further levels, from `blurred_levels`; computed if empty.
        """
        return cls._stacked([picture, *(levels or blurred_levels(picture))], level_widths(len(picture)))

    @classmethod
    def finest_only(cls, picture: NDArray[np.float32]) -> EnvironmentPyramid:
        """Copy level 0 alone to the device, for lookups without blur; `picture` as in `of`."""
        return cls._stacked([picture], level_widths(len(picture))[:1])

    @classmethod
    def of_irradiance(cls, irradiance: NDArray[np.float32]) -> EnvironmentPyramid:
        """Copy an irradiance map to the device: one level, indexed by the normal; see `rsibr.light.irradiance`."""
        return cls._stacked([irradiance], [1.0])

    @classmethod
    def _stacked(cls, levels: list[NDArray[np.float32]], widths: list[float]) -> EnvironmentPyramid:
        images = [packed(bordered(level)).reshape(-1, 2) for level in levels]
        starts = np.cumsum([0, *map(len, images[:-1])])
        return cls(
            texels=to_device(mi.Float, np.concatenate(images).view(np.float32)),
            starts=to_device(mi.UInt32, starts.astype(np.uint32)),
            resolutions=to_device(mi.UInt32, np.array([len(level) for level in levels], dtype=np.uint32)),
            variances=to_device(mi.Float, np.square(widths).astype(np.float32)),
            finest=dr.opaque(mi.Float, widths[min(1, len(widths) - 1)]),
            last=dr.opaque(mi.Float, len(levels) - 1),
        )

    def blurred(self, d: mi.Vector3f, width: mi.Float) -> mi.Color3f:
        """Blurred radiance around a direction, interpolated between two levels.

        Parameters
        ----------
        d : mi.Vector3f
            Unit directions in world coordinates.
        width : mi.Float
            Standard deviation [rad] of the Gaussian.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²]. The levels are weighted so that the variance of the mixture is width².
        """
        lower = mi.UInt32(dr.clip(self._level(width), 0, self.last - 1))
        v0, v1 = dr.gather(mi.Float, self.variances, lower), dr.gather(mi.Float, self.variances, lower + 1)
        share = dr.clip((width * width - v0) / (v1 - v0), 0, 1)
        return dr.lerp(self.fetch(d, lower), self.fetch(d, lower + 1), share)

    def nearest_blurred(self, d: mi.Vector3f, width: mi.Float) -> mi.Color3f:
        """Radiance from the level nearest to `width`: half the lookups of `blurred`; parameters as there."""
        return self.fetch(d, mi.UInt32(dr.clip(self._level(width) + 0.5, 0, self.last)))

    def fetch(self, d: mi.Vector3f, level: mi.UInt32) -> mi.Color3f:
        """Bilinear lookup of the radiance [W sr⁻¹ m⁻²] in one level, in the unit directions `d`."""
        start, resolution = dr.gather(mi.UInt32, self.starts, level), dr.gather(mi.UInt32, self.resolutions, level)
        p, half = square_from_direction(d), 0.5 * mi.Float(resolution)
        cell = BilinearCell.at(dr.fma(p.x, half, half + 0.5), dr.fma(p.y, half, half + 0.5))
        stride = resolution + 2
        corner = cell.corner(stride) + start
        return bilinear(self.texels, cell, corner, corner + 1, stride)

    def _level(self, width: mi.Float) -> mi.Float:
        """Fractional level of a width [rad], < 1 below that of level 1."""
        return 2 * dr.log2(dr.maximum(width, 1e-9) / self.finest) + 1


def level_widths(resolution: int) -> list[float]:
    """Standard deviation [rad] of each level for an image of R×R texels, R = `resolution`.

    Level 0 is the image: a box of one texel and the tent filter of the lookup. Level 1 is one texel wide, and each
    further level √2 times the last, up to the first that reaches `WIDEST`.
    """
    spacing = _spacing(resolution)
    widths = [0.5 * spacing]
    while widths[-1] < WIDEST:
        widths.append(spacing * math.sqrt(2) ** (len(widths) - 1))
    return widths


def level_resolution(resolution: int, width: float) -> int:
    """Texels a side of a level of standard deviation `width` [rad]: `_FINENESS` per standard deviation."""
    return max(_LEAST_RESOLUTION, min(resolution, math.ceil(_FINENESS * _spacing(1) / width)))


def blurred_levels(picture: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Levels 1, 2, … of the pyramid of an environment.

    Parameters
    ----------
    picture : ndarray, shape (R, R, 3)
        Octahedral image of the radiance [W sr⁻¹ m⁻²].

    Returns
    -------
    list of ndarray, shape (R_k, R_k, 3), float32
        Each level is blurred from the previous one by the difference of their variances, with that of the lookup's tent
        filter subtracted. Read-only, for the levels of the last `_REMEMBERED` environments are kept: materials, sizes
        and plans under one sky follow each other.
    """
    key = hashlib.sha256(picture.tobytes()).digest()
    known = _remembered.pop(key) if key in _remembered else _all_levels(picture)
    _remembered[key] = known  # now the last to be forgotten
    while len(_remembered) > _REMEMBERED:
        _remembered.pop(next(iter(_remembered)))
    return list(_remembered[key])


def _all_levels(picture: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    widths, level, levels = level_widths(len(picture)), picture, []
    for before, width in itertools.pairwise(widths):
        resolution = level_resolution(len(picture), width)
        added = width**2 - _spacing(resolution) ** 2 / 6 - before**2
        level = _blurred(EnvironmentPyramid._stacked([level], [before]), math.sqrt(added), resolution)
        level.setflags(write=False)
        levels.append(level)
    return levels


def _spacing(resolution: int) -> float:
    """Mean angle [rad] between neighbouring texels."""
    return math.sqrt(4 * math.pi) / resolution


def _blurred(source: EnvironmentPyramid, width: float, resolution: int) -> NDArray[np.float32]:
    """Blur the only level of `source` by a Gaussian of standard deviation `width` [rad]."""
    # Taps in the tangent plane: a Gaussian cut off at _REACH, rescaled to the full variance
    x, y = (grid.ravel() for grid in np.meshgrid(*[np.linspace(-_REACH, _REACH, _TAPS)] * 2))
    near = np.hypot(x, y) <= _REACH
    x, y, weight = x[near], y[near], np.exp(-0.5 * (x**2 + y**2))[near]
    width *= math.sqrt(weight.sum() / (weight @ x**2))
    taps = np.stack([x * width, y * width, weight / weight.sum(), 0 * weight], axis=1)
    packed, count = to_device(mi.Float, taps.astype(np.float32)), dr.opaque(mi.UInt32, len(taps))
    # Sum of the taps around each texel's direction
    d = texel_directions(resolution)
    frame = frame_of(d)

    def step(i: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
        tap = dr.gather(mi.Vector4f, packed, i)
        angle = dr.sqrt(tap.x * tap.x + tap.y * tap.y)
        sine, cosine = dr.sincos(angle)
        ratio = dr.select(angle > 0, sine / dr.maximum(angle, 1e-9), 1)
        around = frame @ mi.Vector3f(tap.x * ratio, tap.y * ratio, cosine)
        return i + 1, total + tap.z * source.fetch(around, mi.UInt32(0))

    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Color3f, resolution**2)),
        cond=lambda i, _total: i < count,
        body=step,
        labels=("i", "total"),
        label="blur_light",
    )
    return np.array(total, dtype=np.float32).T.reshape(resolution, resolution, 3)

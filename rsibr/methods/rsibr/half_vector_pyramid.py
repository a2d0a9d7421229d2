"""Gaussian pyramid of the reflected environment over half-vectors; one lookup serves all narrow Gaussians.

For one viewer every half-vector reflects one direction, so the reflected environment is an image over the half-vector
map. A narrow microfacet lobe is nearly isotropic over half-vectors, at every surface normal: each Gaussian is a
convolution of this one image with an isotropic kernel. The levels of the pyramid, √2 apart in width, are weighted by
surface angle and summed from the coarsest to the finest. A texel of a sphere map then takes one bilinear lookup, for
any number of Gaussians.

docs/method.md, section 7, derives the method; equation numbers below are those of that page.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.projections.sphere_map import within_disk
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.half_vector_map import angle_per_length, half_vector, half_vector_texels

RESOLUTION = 96
"""Texels a side of level 0, G, by default; a multiple of 16."""

_HALVINGS = 0, 0, 0, 1, 1, 2, 2, 3, 3, 4
_FIRST = 0.36  # variance of level 0 before lookups [texels²]; less would let its texels miss a part of a small lamp
_LOOKUP = 1 / 6  # variance of a bilinear lookup (tent filter) in texels²
_UPSAMPLED = 3 / 16  # the same a quarter of a texel off the centres


def _added(halvings: int) -> float:
    """Variance [texels² of level 0] that the lookups of the collapse add to a level of halved side.

    The lookup in the level itself adds none: without a lean it lies at the centres of its texels.
    """
    return _UPSAMPLED * sum(4.0**k for k in range(1, halvings + 1)) + _LOOKUP


LADDER = tuple(
    (halvings, (_FIRST + _added(0)) * 2.0**level - _added(halvings)) for level, halvings in enumerate(_HALVINGS)
)
"""For each level, how often its side is halved, and its variance before lookups [texels² of level 0].

After the collapse each level has twice the variance of the one before it; the first is blurred by `_FIRST`.
"""

_TAPS = 5, 6  # of a blur along each axis: at the same resolution, and to half of it
_LEAST_HEIGHT = 0.01  # minimum h·v in the width of the environment lookup of level 0


def level_variances() -> NDArray[np.float64]:
    """Variance V_ℓ of each level as it appears in the collapsed map, in texels² of level 0, shape (levels,); eq. 25."""
    return np.array([variance + _added(halvings) for halvings, variance in LADDER])


def lookup_variances() -> NDArray[np.float64]:
    """Variance of a bilinear lookup in each level itself, in texels² of level 0, shape (levels,)."""
    return np.array([variance + _LOOKUP * 4.0**halvings for halvings, variance in LADDER])


def level_places(resolution: int) -> tuple[list[int], list[int]]:
    """Index of the first texel and texels a side of each level of a pyramid with G = `resolution`."""
    sides = [resolution >> halvings for halvings, _ in LADDER]
    return [sum((side + 2) ** 2 for side in sides[:level]) for level in range(len(sides))], sides


def texel_angle(resolution: int, polar_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle [rad] between neighbouring texels of level 0 at a polar angle [rad] from v; eq. 4."""
    return np.asarray(4 / resolution * np.cos(polar_angle / 2) ** 2)


@dataclass(eq=False)
class HalfVectorPyramid:
    """Levels of the reflected environment over the half-vector map of one view.

    Attributes
    ----------
    texels : mi.Float
        RGBA of all levels, one after the other, each with a border of one texel, flat: radiance times h·v, and h·v.
    resolution : int
        Texels a side of level 0, G.
    """

    texels: mi.Float
    resolution: int

    @classmethod
    def of(cls, frame: mi.Matrix3f, light: EnvironmentPyramid, resolution: int = RESOLUTION) -> HalfVectorPyramid:
        """Build the levels for a viewer.

        Parameters
        ----------
        frame : mi.Matrix3f
            Frame of the map, columns x, y, v.
        light : EnvironmentPyramid
            Gaussian pyramid of the environment.
        resolution : int
            Texels a side of level 0, a multiple of 16.
        """
        return cls._over(_mirrored(frame, light, resolution), resolution)

    @classmethod
    def even(cls, resolution: int) -> HalfVectorPyramid:
        """Levels under a constant environment of radiance 1."""
        height = half_vector(half_vector_texels(resolution, border=1)).z
        return cls._over(_stored(mi.Vector4f(dr.maximum(height, 0))), resolution)

    @classmethod
    def _over(cls, finest: mi.Float, resolution: int) -> HalfVectorPyramid:
        levels = [finest]
        for finer, coarser in pairwise(LADDER):
            levels.append(_blurred(levels[-1], finer, coarser, resolution))
        return cls(dr.concat(levels), resolution)

    def collapsed(self, weights: list[CosineTable]) -> mi.Vector4f:
        """Weighted sum of all levels over the texels of level 0, from the coarsest size to the finest (eq. 29).

        Parameters
        ----------
        weights : list of CosineTable
            For each level, by cosine of the surface angle: weight g_ℓ (RGB), and the radius factor φ_ℓ that moves the
            lookup to the centre of the visible lobe (eq. 28).
        """
        starts, _ = level_places(self.resolution)
        total = None
        for halvings in range(LADDER[-1][0], -1, -1):
            members = [(starts[m], weights[m]) for m, (size, _) in enumerate(LADDER) if size == halvings]
            coarser = None if total is None else _stored(total)
            total = _collapsed(self.texels, members, coarser, self.resolution >> halvings)
        return total

    def light(self, p: mi.Point2f, start: mi.UInt32, side: mi.UInt32) -> mi.Color3f:
        """Mean radiance [W sr⁻¹ m⁻²] around map points in the unit disk, each in a level of `level_places`."""
        found = lookup(self.texels, p, side, start)
        return mi.Color3f(found.x, found.y, found.z) / dr.maximum(found.w, 1e-6)


def balanced(pyramid: HalfVectorPyramid, weights: list[CosineTable], balance: mi.Float) -> mi.Float:
    """Collapse the pyramid and multiply by the factors β of `balance`: RGBA over the map with its border, flat."""
    texel = dr.arange(mi.UInt32, (pyramid.resolution + 2) ** 2)
    return _stored(pyramid.collapsed(weights) * dr.gather(mi.Vector4f, balance, texel))


def balance(weights: list[CosineTable], resolution: int) -> mi.Float:
    """Factors β on the texels of the collapsed map that make a constant environment exact; eq. 30.

    A coarse level has too few texels to follow weights that change fast with the surface angle. Without the factors
    the radiance under a constant environment would be off.

    Parameters
    ----------
    weights : list of CosineTable
        As in `HalfVectorPyramid.collapsed`.
    resolution : int
        Texels a side of level 0, G.

    Returns
    -------
    mi.Float
        RGBA of the map with its border, flat; A is unused.
    """
    even = HalfVectorPyramid.even(resolution).collapsed(weights)
    cosine = half_vector(within_disk(half_vector_texels(resolution, border=1))).z
    wanted = mi.Vector4f(0)
    for weight in weights:
        wanted += weight.at(cosine)
    return _stored(wanted / dr.maximum(even, 1e-20))


def lookup(texels: mi.Float, p: mi.Point2f, resolution: mi.UInt32 | int, start: mi.UInt32 | int = 0) -> mi.Vector4f:
    """Bilinear lookup in a half-vector map of G×G texels with a border of one texel.

    Parameters
    ----------
    texels : mi.Float
        RGBA, row-major, flat.
    p : mi.Point2f
        Map points in the unit disk.
    resolution : mi.UInt32 or int
        Texels a side without the border, G.
    start : mi.UInt32 or int
        Index of the map's first texel.

    Returns
    -------
    mi.Vector4f
        RGBA.
    """
    stride, cell = resolution + 2, BilinearCell.in_sphere_map(p, 0.5 * mi.Float(resolution))
    corner = cell.corner(stride) + start

    def texel(offset: mi.UInt32 | int) -> mi.Vector4f:
        return dr.gather(mi.Vector4f, texels, corner + offset)

    upper = dr.lerp(texel(0), texel(1), cell.rightward)
    return dr.lerp(upper, dr.lerp(texel(stride), texel(stride + 1), cell.rightward), cell.downward)


def _mirrored(frame: mi.Matrix3f, light: EnvironmentPyramid, resolution: int) -> mi.Float:
    """Level 0: environment reflected by each half-vector, times h·v, with h·v in the fourth channel (eq. 22)."""
    p = half_vector_texels(resolution, border=1)
    h = half_vector(p)
    seen = dr.maximum(h.z, 0)
    direction = frame @ mi.Vector3f(2 * h.z * h.x, 2 * h.z * h.y, 2 * h.z * h.z - 1)
    # An angle δ between half-vectors is 2δ by 2δ h_z between directions of light: a circle of 2δ √h_z in area
    blur = 2 * math.sqrt(_FIRST) * (2 / resolution)
    width = blur * angle_per_length(p) * dr.sqrt(dr.maximum(seen, _LEAST_HEIGHT))
    radiance = light.blurred(direction, width) * seen
    return _stored(mi.Vector4f(radiance.x, radiance.y, radiance.z, seen))


def _blurred(finer: mi.Float, before: tuple[int, float], after: tuple[int, float], resolution: int) -> mi.Float:
    """Next level: blurred to its variance, along the rows, then along the columns; zero beyond the map (eq. 23)."""
    halves = after[0] > before[0]
    kernel = taps(before, after)
    fine, coarse = (resolution >> halvings for halvings in (before[0], after[0]))
    along = _convolved(finer, kernel, (fine, coarse), (fine, fine), halves, by_row=True)
    return _convolved(along, kernel, (coarse, coarse), (fine, coarse), halves, by_row=False)


def _convolved(
    source: mi.Float,
    kernel: NDArray[np.float64],
    columns: tuple[int, int],
    rows: tuple[int, int],
    halves: bool,
    *,
    by_row: bool,
) -> mi.Float:
    """Convolve along one axis; `columns` and `rows` are the sides before and after, without borders."""
    before = columns[0] if by_row else rows[0]
    width, stride = columns[1] + 2, columns[0] + 2
    index = dr.arange(mi.UInt32, width * (rows[1] + 2))
    row, column = mi.Int32(index // width), mi.Int32(index % width)
    place = column if by_row else row
    # First tap: texel k of the coarser side covers texels 2k − 1 and 2k of the finer one, borders counted
    first = (2 * place - len(kernel) // 2) if halves else (place - len(kernel) // 2)
    total = mi.Vector4f(0)
    for k, weight in enumerate(kernel):
        at = first + k
        inside = (at >= 0) & (at < before + 2)
        texel = row * stride + at if by_row else at * stride + column
        total += float(weight) * dr.gather(mi.Vector4f, source, mi.UInt32(texel), inside)
    return _stored(total)


def taps(before: tuple[int, float], after: tuple[int, float]) -> NDArray[np.float64]:
    """Kernel between two levels of `LADDER`: samples of a Gaussian whose variance, cut off, is what is to be added.

    Examples
    --------
    >>> kernel = taps((0, 0.25), (0, 1.0))
    >>> len(kernel), round(float(kernel @ np.arange(-2, 3.0) ** 2), 6)
    (5, 0.75)
    """
    count = _TAPS[int(after[0] > before[0])]
    places = np.arange(count) - (count - 1) / 2
    added = (after[1] - before[1]) / 4.0 ** before[0]

    def kernel(variance: float) -> NDArray[np.float64]:
        weights = np.exp(-0.5 * places**2 / variance)
        return np.asarray(weights / weights.sum())

    return kernel(float(brentq(lambda variance: kernel(variance) @ places**2 - added, 1e-2, 1e3)))


def _collapsed(
    texels: mi.Float, levels: list[tuple[int, CosineTable]], coarser: mi.Float | None, resolution: int
) -> mi.Vector4f:
    """One step of the collapse: weighted radiance of the levels of one size, plus the sum of all coarser ones."""
    p = within_disk(half_vector_texels(resolution, border=1))
    cosine = half_vector(p).z
    total = mi.Vector4f(0)
    for start, weight in levels:
        share = weight.at(cosine)
        light = lookup(texels, p * share.w, resolution, start)
        total += mi.Vector4f(share.x * light.x, share.y * light.y, share.z * light.z, 0) / dr.maximum(light.w, 1e-6)
    return total if coarser is None else total + lookup(coarser, p, resolution // 2)


def _stored(texels: mi.Vector4f) -> mi.Float:
    flat = dr.ravel(texels)
    dr.eval(flat)
    return flat

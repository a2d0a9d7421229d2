"""What a mirror sphere would show of the light, blurred at doubling widths: the light of every lobe at once.

For one viewer every facet mirrors one direction. A microfacet lobe is round over the facets, wherever on the sphere it
sits; so the picture of the mirrored light over the facets, blurred by round Gaussians, holds what each lobe gathers at
each surface. The levels are weighed and summed from the coarsest to the finest: a texel of a sphere map then needs one
lookup, however many lobes there are.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.projections.sphere_map import within_disk
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.half_vector_map import angle_per_length, half_vector, half_vector_texels

LEVELS = 5
"""Images of the pyramid, each with half the texels a side of the last."""

_COARSEST = 5, 16  # texels a side of the last level: least, most
_TAPS = 6
_ADDED = 3.0  # variance of the blur from one level to the next, in texels² of the finer: doubles a width of one texel
_FIRST = 0.25  # variance of the first level, in its texels²: what each texel was looked up with
_LOOKUP = 1 / 6  # variance of a bilinear lookup, in texels²
_LEAST_HEIGHT = 0.01


def finest_resolution(resolution: int) -> int:
    """Texels a side of the first level for sphere maps of N×N texels.

    A quarter of N, but not below 80 nor above 256, and a multiple of 16: what is narrower than its texels is looked
    up in the light itself. Finer ones take more time, and were not seen to err less.
    """
    unit: int = 2 ** (LEVELS - 1)
    least, most = _COARSEST
    return unit * min(max(round(0.25 * resolution / unit), least), most)


def level_variances() -> NDArray[np.float64]:
    """Variance that a lookup in each level amounts to, in texels² of the first level, shape (LEVELS,)."""
    taps = _taps()
    added = (taps * _offsets() ** 2).sum()
    blurred = _FIRST + added * np.concatenate([[0.0], np.cumsum(4.0 ** np.arange(LEVELS - 1))])
    return np.asarray(blurred + _LOOKUP * 4.0 ** np.arange(LEVELS))


def texel_angle(resolution: int, polar_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle [rad] between neighbouring texels of a facet map of G×G texels, at a facet's angle from the viewer."""
    return np.asarray(4 / resolution * np.cos(polar_angle / 2) ** 2)


def gathered(
    frame: mi.Matrix3f, light: EnvironmentPyramid, weights: list[CosineTable], balance: mi.Float, resolution: int
) -> mi.Float:
    """Light that the lobes gather, over the facet map of a viewer.

    Parameters
    ----------
    frame : mi.Matrix3f
        Columns x, y, v: the viewer's frame.
    light : EnvironmentPyramid
        The light, blurred.
    weights : list of CosineTable
        For each level the weight of its light over the angle of the surface, RGB; and the factor on the radius in the
        map that leads to where the facets of the level that are seen to shine have their middle.
    balance : mi.Float
        From `balance` for the same weights and resolution.
    resolution : int
        Texels a side of the first level, G; see `finest_resolution`.

    Returns
    -------
    mi.Float
        RGBA of the map with a border of one texel, flat: Σ weight × light; for `lookup`.
    """
    total = _summed(_mirrored(frame, light, resolution), weights, resolution)
    return _stored(total * dr.gather(mi.Vector4f, balance, dr.arange(mi.UInt32, (resolution + 2) ** 2)))


def balance(weights: list[CosineTable], resolution: int) -> mi.Float:
    """Factors on the texels of a map that make an even light come back as the weights say.

    Between the few texels of a coarse level weights that change with the angle are not followed; without the factors up
    to 5 % of an even light would be lost or won.

    Returns
    -------
    mi.Float
        RGBA of the map with its border, flat; A means nothing.
    """
    p = half_vector_texels(resolution, border=1)
    even = _summed(_stored(mi.Vector4f(dr.maximum(half_vector(p).z, 0))), weights, resolution)
    cosine = half_vector(within_disk(p)).z
    wanted = mi.Vector4f(0)
    for weight in weights:
        wanted += weight.at(cosine)
    return _stored(wanted / dr.maximum(even, 1e-20))


def lookup(texels: mi.Float, resolution: int, p: mi.Point2f) -> mi.Vector4f:
    """Bilinear lookup in a facet map of G×G texels with a border of one.

    Parameters
    ----------
    texels : mi.Float
        RGBA, row-major, flat.
    resolution : int
        G.
    p : mi.Point2f
        Points of the unit disk.
    """
    stride, cell = resolution + 2, BilinearCell.in_sphere_map(p, 0.5 * resolution)
    corner = cell.corner(stride)

    def texel(offset: int) -> mi.Vector4f:
        return dr.gather(mi.Vector4f, texels, corner + offset)

    upper = dr.lerp(texel(0), texel(1), cell.rightward)
    return dr.lerp(upper, dr.lerp(texel(stride), texel(stride + 1), cell.rightward), cell.downward)


def _summed(finest: mi.Float, weights: list[CosineTable], resolution: int) -> mi.Vector4f:
    """Weighted sum of the pyramid over the first level `finest`, from the coarsest level down to it."""
    levels = [finest]
    for level in range(1, LEVELS):
        levels.append(_halved(levels[-1], resolution >> (level - 1)))
    total = None
    for level in reversed(range(LEVELS)):
        coarser = None if total is None else _stored(total)
        total = _collapsed(levels[level], coarser, weights[level], resolution >> level)
    return total


def _mirrored(frame: mi.Matrix3f, light: EnvironmentPyramid, resolution: int) -> mi.Float:
    """First level: the light that each facet mirrors, weighed by the area that the viewer sees of the facet."""
    p = half_vector_texels(resolution, border=1)
    h = half_vector(p)
    seen = dr.maximum(h.z, 0)
    direction = frame @ mi.Vector3f(2 * h.z * h.x, 2 * h.z * h.y, 2 * h.z * h.z - 1)
    # A texel's facets mirror into an ellipse, twice as wide as the texel and 2 cos θ: a disk of equal area
    width = angle_per_length(p) * (2 / resolution) * dr.sqrt(dr.maximum(seen, _LEAST_HEIGHT))
    radiance = light.nearest_blurred(direction, width) * seen
    return _stored(mi.Vector4f(radiance.x, radiance.y, radiance.z, seen))


def _halved(finer: mi.Float, resolution: int) -> mi.Float:
    """Next level: blurred to twice the width, at half the texels a side. Beyond the map there is no light."""
    side, stride = resolution // 2 + 2, resolution + 2
    index = dr.arange(mi.UInt32, side * side)
    first_row = 2 * mi.Int32(index // side) - _TAPS // 2
    first_column = 2 * mi.Int32(index % side) - _TAPS // 2
    total = mi.Vector4f(0)
    weights = _taps()
    for i, down in enumerate(weights):
        row = first_row + i
        for j, right in enumerate(weights):
            column = first_column + j
            inside = (row >= 0) & (row < stride) & (column >= 0) & (column < stride)
            total += float(down * right) * dr.gather(mi.Vector4f, finer, mi.UInt32(row * stride + column), inside)
    return _stored(total)


def _collapsed(level: mi.Float, coarser: mi.Float | None, weight: CosineTable, resolution: int) -> mi.Vector4f:
    """Light of this level and all coarser ones, each by its weight."""
    p = within_disk(half_vector_texels(resolution, border=1))
    share = weight.at(half_vector(p).z)
    light = lookup(level, resolution, p * share.w)
    total = mi.Vector4f(share.x * light.x, share.y * light.y, share.z * light.z, 0) / dr.maximum(light.w, 1e-6)
    if coarser is not None:
        total += lookup(coarser, resolution // 2, p)
    return total


def _stored(texels: mi.Vector4f) -> mi.Float:
    flat = dr.ravel(texels)
    dr.eval(flat)
    return flat


def _offsets() -> NDArray[np.float64]:
    return np.arange(_TAPS, dtype=np.float64) - (_TAPS - 1) / 2


def _taps() -> NDArray[np.float64]:
    weights = np.exp(-0.5 * _offsets() ** 2 / _ADDED)
    return np.asarray(weights / weights.sum())

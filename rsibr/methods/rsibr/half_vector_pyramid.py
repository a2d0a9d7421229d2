"""Gaussian pyramid of the reflected environment over half-vectors; one lookup serves all glossy lobes.

For one viewer every half-vector reflects one direction, so the reflected environment is an image over the half-vector
map. A microfacet lobe is nearly isotropic over half-vectors, at every surface normal: each lobe is a convolution of
this one image with isotropic Gaussians. The levels of the pyramid are weighted by surface angle and summed from the
coarsest to the finest. A texel of a sphere map then takes one bilinear lookup, for any number of lobes.

docs/method.md, section 7, derives the method; equation numbers below are those of that page.
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
"""Levels of the pyramid, each with half the texels a side of the previous one."""

_COARSEST = 5, 16  # texels a side of the coarsest level: minimum, maximum
_TAPS = 6
_ADDED = 3.0  # variance of the Gaussian that the taps sample, in texels² of the finer level; six taps keep 1.9965 of it
_FIRST = 0.25  # variance of level 0 in its texels²: blur of the environment lookup of each texel
_LOOKUP = 1 / 6  # variance of a bilinear lookup (tent filter) in texels²
_LEAST_HEIGHT = 0.01  # minimum h·v in the width of that lookup


def finest_resolution(resolution: int) -> int:
    """Texels a side of level 0 for sphere maps of N×N texels: N/4 as a multiple of 16, in [80, 256].

    Gaussians narrower than its texels are looked up in the environment pyramid instead. Higher resolutions were
    measured to be slower without being more accurate.
    """
    unit: int = 2 ** (LEVELS - 1)
    least, most = _COARSEST
    return unit * min(max(round(0.25 * resolution / unit), least), most)


def level_variances() -> NDArray[np.float64]:
    """Variance V_ℓ of a bilinear lookup in each level, in texels² of level 0, shape (LEVELS,); eq. 24."""
    taps = _taps()
    added = (taps * _offsets() ** 2).sum()
    blurred = _FIRST + added * np.concatenate([[0.0], np.cumsum(4.0 ** np.arange(LEVELS - 1))])
    return np.asarray(blurred + _LOOKUP * 4.0 ** np.arange(LEVELS))


def texel_angle(resolution: int, polar_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle [rad] between neighbouring texels of a G×G half-vector map at a polar angle [rad] from v; eq. 4."""
    return np.asarray(4 / resolution * np.cos(polar_angle / 2) ** 2)


def gathered(
    frame: mi.Matrix3f, light: EnvironmentPyramid, weights: list[CosineTable], balance: mi.Float, resolution: int
) -> mi.Float:
    """Build and collapse the pyramid: radiance of all glossy lobes over the half-vector map of a viewer.

    Parameters
    ----------
    frame : mi.Matrix3f
        Frame of the map, columns x, y, v.
    light : EnvironmentPyramid
        Gaussian pyramid of the environment.
    weights : list of CosineTable
        For each level, by cosine of the surface angle: weight g_ℓ (RGB), and the radius factor φ_ℓ that moves the
        lookup to the centre of the visible lobe (eq. 28).
    balance : mi.Float
        Factors β from `balance` for the same weights and resolution.
    resolution : int
        Texels a side of level 0, G; see `finest_resolution`.

    Returns
    -------
    mi.Float
        RGBA of the half-vector map with a border of one texel, flat, for `lookup`: Σ_ℓ g_ℓ · radiance [W sr⁻¹ m⁻²].
    """
    total = _summed(_mirrored(frame, light, resolution), weights, resolution)
    return _stored(total * dr.gather(mi.Vector4f, balance, dr.arange(mi.UInt32, (resolution + 2) ** 2)))


def balance(weights: list[CosineTable], resolution: int) -> mi.Float:
    """Factors β on the texels of the collapsed map that make a constant environment exact; eq. 30.

    A coarse level has too few texels to follow weights that change fast with the surface angle. Without the factors
    the radiance under a constant environment would be off; over six presets the factors lie between 0.92 and 1.15.

    Parameters
    ----------
    weights, resolution
        As in `gathered`.

    Returns
    -------
    mi.Float
        RGBA of the map with its border, flat; A is unused.
    """
    p = half_vector_texels(resolution, border=1)
    even = _summed(_stored(mi.Vector4f(dr.maximum(half_vector(p).z, 0))), weights, resolution)
    cosine = half_vector(within_disk(p)).z
    wanted = mi.Vector4f(0)
    for weight in weights:
        wanted += weight.at(cosine)
    return _stored(wanted / dr.maximum(even, 1e-20))


def lookup(texels: mi.Float, resolution: int, p: mi.Point2f) -> mi.Vector4f:
    """Bilinear lookup in a half-vector map of G×G texels with a border of one texel.

    Parameters
    ----------
    texels : mi.Float
        RGBA, row-major, flat.
    resolution : int
        Texels a side without the border, G.
    p : mi.Point2f
        Map points in the unit disk.

    Returns
    -------
    mi.Vector4f
        RGBA.
    """
    stride, cell = resolution + 2, BilinearCell.in_sphere_map(p, 0.5 * resolution)
    corner = cell.corner(stride)

    def texel(offset: int) -> mi.Vector4f:
        return dr.gather(mi.Vector4f, texels, corner + offset)

    upper = dr.lerp(texel(0), texel(1), cell.rightward)
    return dr.lerp(upper, dr.lerp(texel(stride), texel(stride + 1), cell.rightward), cell.downward)


def _summed(finest: mi.Float, weights: list[CosineTable], resolution: int) -> mi.Vector4f:
    """Build the pyramid over level 0 (`finest`), and collapse it from the coarsest level to the finest (eq. 29)."""
    levels = [finest]
    for level in range(1, LEVELS):
        levels.append(_halved(levels[-1], resolution >> (level - 1)))
    total = None
    for level in reversed(range(LEVELS)):
        coarser = None if total is None else _stored(total)
        total = _collapsed(levels[level], coarser, weights[level], resolution >> level)
    return total


def _mirrored(frame: mi.Matrix3f, light: EnvironmentPyramid, resolution: int) -> mi.Float:
    """Level 0: environment reflected by each half-vector, times h·v, with h·v in the fourth channel (eq. 22)."""
    p = half_vector_texels(resolution, border=1)
    h = half_vector(p)
    seen = dr.maximum(h.z, 0)
    direction = frame @ mi.Vector3f(2 * h.z * h.x, 2 * h.z * h.y, 2 * h.z * h.z - 1)
    # A texel of width δ reflects into an ellipse of 2δ by 2δ h_z. Half the width of the circle of equal area: δ √h_z
    width = angle_per_length(p) * (2 / resolution) * dr.sqrt(dr.maximum(seen, _LEAST_HEIGHT))
    radiance = light.nearest_blurred(direction, width) * seen
    return _stored(mi.Vector4f(radiance.x, radiance.y, radiance.z, seen))


def _halved(finer: mi.Float, resolution: int) -> mi.Float:
    """Next level: blurred to twice the width, with half the texels a side; zero beyond the map (eq. 23)."""
    # ---- Place of the first of the 6 × 6 taps in the finer level ----
    side, stride = resolution // 2 + 2, resolution + 2
    index = dr.arange(mi.UInt32, side * side)
    first_row = 2 * mi.Int32(index // side) - _TAPS // 2
    first_column = 2 * mi.Int32(index % side) - _TAPS // 2
    # ---- Separable kernel, border included ----
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
    """One step of the collapse: weighted radiance of this level, plus the sum of all coarser ones (eq. 29)."""
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

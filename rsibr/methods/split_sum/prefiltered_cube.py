"""GGX-prefiltered cube of the environment, for a lobe's own roughness, or in a chain of MIP levels as in engines."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.geometry.projections.cube import CUBE
from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.geometry.projections.sphere_image import SphereImage
from rsibr.geometry.projections.sphere_image import texel_directions as cube_directions
from rsibr.light.projected import light_in
from rsibr.light.radiance import Light
from rsibr.methods.split_sum.ggx_kernel import GGXKernel
from rsibr.methods.split_sum.multilevel_sum import PointSources, finest_size, level_sums, summed

WIDE = 0.06
"""Roughness α from which a cube of `COARSE` texels a side holds a lobe: five texels in its half-width 2α."""

COARSE, FINE = 64, 128
"""Texels a side of a face: of a wide lobe, and of a narrow one."""

SHARP = 256
"""The same of an environment that is not filtered: texels of 0.35° as in a bake's stored light."""

SMALLEST = 16
"""Texels a side of the last MIP level (Filament's `cmgen --ibl-min-lod-size`)."""


@dataclass(frozen=True, eq=False)
class Sources:
    """Light, and its texels as point sources.

    Attributes
    ----------
    light : Light
        The light; delta lights are not among the sources.
    points : PointSources
        One source a texel of its octahedral image.
    """

    light: Light
    points: PointSources

    @classmethod
    def of(cls, light: Light) -> Sources:
        """Sources of a bake's light."""
        size = len(light.picture)
        directions = np.array(texel_directions(size), dtype=np.float64).T
        angles = texel_solid_angles(size)[:, None]
        weights = np.concatenate([light.picture.reshape(-1, 3) * angles, angles], axis=1)
        return cls(light, PointSources(directions / np.linalg.norm(directions, axis=1, keepdims=True), weights))


def prefiltered(sources: PointSources, alpha: float, size: int) -> NDArray[np.float32]:
    """GGX-prefiltered radiance in the directions of a cube's texels.

    Parameters
    ----------
    sources : PointSources
        Light.
    alpha : float
        Roughness α.
    size : int
        Texels a side of a face.

    Returns
    -------
    ndarray, shape (6, size, size, 3), float32
        ∫ K L dω / ∫ K dω [W sr⁻¹ m⁻²] with the kernel of `GGXKernel`; never negative for light that is not.

    Notes
    -----
    Numerator and denominator are sums over the same charts, so that constant light stays what it is within 2e-3.
    """
    levels = level_sums(sources, GGXKernel(alpha), finest_size(alpha))
    sums = summed(levels, cube_directions(CUBE, size))
    radiance = mi.Vector3f(sums.x, sums.y, sums.z) / sums.w
    return np.array(radiance, dtype=np.float32).T.reshape(6, size, size, 3)


def cube_size(alpha: float) -> int:
    """Texels a side of a face that hold a lobe of roughness `alpha`."""
    if alpha < least_alpha(FINE):
        return SHARP
    return COARSE if alpha >= WIDE else FINE


def least_alpha(size: int) -> float:
    """Roughness below which a kernel's half-width 2α is less than the distance of a cube's texels."""
    return float(np.pi / 4 / size)


def roughness_of_level(level: int, count: int) -> float:
    """Roughness α of MIP level `level` of `count`.

    Notes
    -----
    Filament stores the perceptual roughness p = √α at the level (count − 1) p (2 − p).
    """
    return float((1 - np.sqrt(1 - level / max(count - 1, 1))) ** 2)


def level_of_roughness(alpha: float, count: int) -> float:
    """Fractional MIP level of roughness α: the inverse of `roughness_of_level`."""
    perceptual = float(np.sqrt(alpha))
    return (count - 1) * perceptual * (2 - perceptual)


@dataclass(eq=False)
class PrefilteredCube:
    """One cube, or two neighbouring MIP levels and the place between them.

    Attributes
    ----------
    lower, upper : BorderedTexels
        Texels on the device; the same twice without a chain.
    share : mi.Float or None
        Weight of `upper` (opaque); None without a chain.
    alpha : float
        Roughness α that the cube is prefiltered for.
    """

    lower: BorderedTexels
    upper: BorderedTexels
    share: mi.Float | None
    alpha: float

    @classmethod
    def exact(cls, sources: Sources, alpha: float, size: int | None = None) -> PrefilteredCube:
        """Prefilter for one roughness.

        Parameters
        ----------
        sources : Sources
            Light.
        alpha : float
            Roughness α; 0 for the environment itself.
        size : int, optional
            Texels a side of a face; `cube_size` by default.
        """
        texels = _level(sources, alpha, size or cube_size(alpha))
        return cls(texels, texels, None, alpha)

    @classmethod
    def in_chain(cls, chain: list[BorderedTexels], alpha: float) -> PrefilteredCube:
        """Two levels of a chain around a roughness; as a texture unit interpolates them."""
        place = level_of_roughness(min(alpha, 1.0), len(chain))
        below = min(int(place), len(chain) - 2)
        return cls(chain[below], chain[below + 1], dr.opaque(mi.Float, place - below), alpha)

    def lookup(self, d: mi.Vector3f) -> mi.Color3f:
        """Radiance [W sr⁻¹ m⁻²] in unit directions."""
        place = CUBE.place(d)
        value = self.lower.lookup(*place)
        if self.share is not None:
            value = dr.lerp(value, self.upper.lookup(*place), self.share)
        return mi.Color3f(value.x, value.y, value.z)


def mip_sizes(size: int = SHARP) -> list[int]:
    """Texels a side of the MIP levels from `size` down to `SMALLEST`, at least two levels.

    Examples
    --------
    >>> mip_sizes(64)
    [64, 32, 16]
    """
    sizes = [size]
    while sizes[-1] // 2 >= SMALLEST:
        sizes.append(sizes[-1] // 2)
    return sizes if len(sizes) > 1 else sizes * 2


def mip_chain(sources: Sources, size: int = SHARP) -> list[BorderedTexels]:
    """MIP levels of `mip_sizes`: the environment itself, and wider and wider lobes."""
    sizes = mip_sizes(size)
    return [_level(sources, roughness_of_level(level, len(sizes)), one) for level, one in enumerate(sizes)]


def lobe_cube(sources: Sources, alpha: float, size: int) -> NDArray[np.float32]:
    """Radiance prefiltered for a lobe, shape (6, size, size, 3); the environment itself below `least_alpha`."""
    if alpha < least_alpha(size):
        return light_in(sources.light, CUBE, size)
    return prefiltered(sources.points, alpha, size)


def _level(sources: Sources, alpha: float, size: int) -> BorderedTexels:
    """One cube on the device."""
    return SphereImage(CUBE, lobe_cube(sources, alpha, size)).texels

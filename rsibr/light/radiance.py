"""Environment as stored with a bake: octahedral image, original image, pyramid levels and irradiance maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.octahedral import texel_directions
from rsibr.light.environment_pyramid import blurred_levels
from rsibr.light.irradiance import irradiance_map
from rsibr.scene.wavelengths import Wavelengths

if TYPE_CHECKING:
    from rsibr.scene.environment import Environment  # a quarter of a second to import, and only a type here

RESOLUTION = 512
"""Texels a side: 0.4° each, as fine as an environment map of 1024 × 512."""

DELTA_RESOLUTION = 1024
"""Texels a side for a material with a delta lobe, if the environment is not an image."""

_SAME = 1e-6
"""Tolerance within which two sets of weights are equal: they are stored in float32."""

_LEAST_COLUMNS = 2
"""Columns, and rows less one, below which Mitsuba resamples an image, so that the original must not be used."""

_WAVELENGTHS = 64
"""Points of the quadrature over wavelengths, four wavelengths each: 2 nm apart."""

_POINTS = 3  # samples a side of a texel: at least, and per texel of the environment's image
_MOST_POINTS = 24


@dataclass(frozen=True, eq=False)
class Irradiance:
    """Environment integrated over the cosine lobe of a matte lobe.

    Attributes
    ----------
    weights : ndarray, shape (2, 3)
        Weights of the bare and the coated cosine lobe; see `rsibr.light.irradiance.irradiance_map`.
    image : ndarray, shape (N, N, 3), float32
        Radiance [W sr⁻¹ m⁻²], octahedral, indexed by the surface normal.
    """

    weights: NDArray[np.float64]
    image: NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Light:
    """Environment of a bake.

    Attributes
    ----------
    picture : ndarray, shape (R, R, 3), float32
        Mean radiance [W sr⁻¹ m⁻²] over octahedral texels; see `light_map`. Source of the environment pyramid.
    image : ndarray, shape (H, W, 3), float32, or None
        Original latitude–longitude image, kept for a delta lobe, which reflects it at full resolution: column i at
        u = (i+½)/W, row j at v = j/(H−1). None without a delta lobe or without an image.
    frame : ndarray, shape (3, 3)
        Axes of the image in world coordinates, in columns: +Y is up, and u = 0 lies at −Z.
    levels : tuple of ndarray, shape (R_k, R_k, 3), float32
        Levels 1, 2, … of the environment pyramid, see `rsibr.light.environment_pyramid.blurred_levels`; empty without a
        glossy lobe.
    irradiances : tuple of Irradiance
        One for each matte lobe.
    """

    picture: NDArray[np.float32]
    image: NDArray[np.float32] | None = None
    frame: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    levels: tuple[NDArray[np.float32], ...] = ()
    irradiances: tuple[Irradiance, ...] = ()

    def __repr__(self) -> str:
        kept = [f"picture {len(self.picture)}²", *([] if self.image is None else ["image"])]
        return f"Light({', '.join(kept)}, {len(self.levels)} levels, {len(self.irradiances)} irradiance maps)"

    @property
    def nbytes(self) -> int:
        """Size in memory [bytes]."""
        images = [self.picture, *self.levels, *(one.image for one in self.irradiances)]
        return sum(image.nbytes for image in images) + (0 if self.image is None else self.image.nbytes)

    def with_tables(self, *, glossy: bool, matte: Sequence[NDArray[np.float64]]) -> Light:
        """Return the same environment with its pyramid levels and irradiance maps, which reconstructions then reuse.

        Parameters
        ----------
        glossy : bool
            Whether a lobe is glossy and needs the levels of the pyramid.
        matte : sequence of ndarray, shape (2, 3)
            Weights of the bare and the coated part of each matte lobe; see `rsibr.light.irradiance.irradiance_map`.
        """
        levels = tuple(blurred_levels(self.picture)) if glossy else ()
        maps = tuple(Irradiance(weights, irradiance_map(self.picture, weights)) for weights in matte)
        return replace(self, levels=levels, irradiances=maps)

    def irradiance(self, weights: NDArray[np.float64]) -> NDArray[np.float32]:
        """Irradiance map for a matte lobe with these `weights`, shape (2, 3): stored, or computed."""
        for known in self.irradiances:
            if np.allclose(known.weights, weights, rtol=_SAME, atol=_SAME):
                return known.image
        return irradiance_map(self.picture, weights)


def light_of(environment: Environment, with_image: bool) -> Light:
    """Evaluate an environment in all directions.

    Parameters
    ----------
    environment : Environment
        Environment of the bake, evaluated in the current variant of Mitsuba.
    with_image : bool
        Whether to keep its original image or, if it has none, to raise the resolution of `picture` to
        `DELTA_RESOLUTION`: what a delta lobe needs.
    """
    emitter, width, image, frame = environment.emitter(), environment.width, environment.image, environment.frame
    if not with_image:
        return Light(light_map(emitter, width))
    if image is None or frame is None or min(image.shape[0] - 1, image.shape[1]) < _LEAST_COLUMNS:
        return Light(light_map(emitter, width, DELTA_RESOLUTION))
    return Light(light_map(emitter, width), image, frame)


def light_map(emitter: dict[str, Any], width: int = 0, resolution: int = RESOLUTION) -> NDArray[np.float32]:
    """Mean radiance of an emitter over each texel of an octahedral image.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity.
    width : int
        Columns of its image, or 0; a finer image is supersampled more.
    resolution : int
        Texels a side, R.

    Returns
    -------
    ndarray, shape (R, R, 3), float32
        Radiance [W sr⁻¹ m⁻²]; see `rsibr.geometry.projections.octahedral`. Black if the emitter has no extent, such as
        `directional`.
    """
    environment = backend.load({"type": "scene", "light": emitter}).environment()
    if environment is None:
        return np.zeros((resolution, resolution, 3), dtype=np.float32)
    finer = math.ceil(_POINTS * width / (math.sqrt(math.pi) * resolution))  # a texel's angle over 2π/width
    points = min(max(_POINTS, finer), _MOST_POINTS)
    total = dr.zeros(mi.Color3f, resolution**2)  # a constant emitter returns one lane for all
    offsets = (np.arange(points) + 0.5) / points
    for right in offsets:
        for down in offsets:  # one pass a sample, to bound the memory
            total += _radiance(environment, texel_directions(resolution, float(right), float(down)))
            dr.eval(total)
    return np.array(total / points**2, dtype=np.float32).T.reshape(resolution, resolution, 3)


def _radiance(environment: mi.Emitter, d: mi.Vector3f) -> mi.Color3f:
    """Radiance from the direction `d`; in spectral rendering, integrated to linear RGB."""
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

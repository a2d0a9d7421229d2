"""Environment as stored with a bake: octahedral image, original image, pyramid levels and irradiance maps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.octahedral import texel_directions
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.emitter_draws import EmitterDraws
from rsibr.light.environment_pyramid import blurred_levels
from rsibr.light.irradiance import BARE, COATED, irradiance_map, mixed
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

_POINTS_OF_A_SOURCE = 1024
"""Sample points in a source of uniform radiance below which it is drawn from instead: points err by about 0.5 % there,
and by 5 % in a sun of 0.5°, which holds 20."""


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
        One for each matte lobe. Without the delta lights.
    delta : DeltaLights
        Lights without extent, which no image holds.
    proxy_ratios : dict of str to ndarray, shape (N, N, 3), float32
        For each lobe that reflects delta lights, the ratio to its proxy (`rsibr.lobes.proxy_ratio`); empty without
        delta lights.
    """

    picture: NDArray[np.float32]
    image: NDArray[np.float32] | None = None
    frame: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    levels: tuple[NDArray[np.float32], ...] = ()
    irradiances: tuple[Irradiance, ...] = ()
    delta: DeltaLights = field(default_factory=DeltaLights.none)
    proxy_ratios: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)

    def __repr__(self) -> str:
        kept = [f"picture {len(self.picture)}²", *([] if self.image is None else ["image"])]
        kept += [f"{len(self.levels)} levels", f"{len(self.irradiances)} irradiance maps", f"{len(self.delta)} deltas"]
        return f"Light({', '.join(kept)})"

    @property
    def is_black(self) -> bool:
        """Whether there is no light at all."""
        return self.delta.is_black and not self.picture.any()

    @property
    def nbytes(self) -> int:
        """Size in memory [bytes]."""
        images = [self.picture, *self.levels, *(one.image for one in self.irradiances), *self.proxy_ratios.values()]
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

    def in_one_channel(self) -> Light:
        """Return the same environment with its red channel for all three, as in a bake of `effects.colour` off."""
        return replace(
            self,
            picture=_red(self.picture),
            image=None if self.image is None else _red(self.image),
            levels=tuple(map(_red, self.levels)),
            irradiances=tuple(Irradiance(_red(one.weights), _red(one.image)) for one in self.irradiances),
            delta=DeltaLights(self.delta.directions, _red(self.delta.irradiance)),
            proxy_ratios={name: _red(ratio) for name, ratio in self.proxy_ratios.items()},
        )

    def irradiance(self, weights: NDArray[np.float64]) -> NDArray[np.float32]:
        """Irradiance map for a matte lobe with these `weights`, shape (2, 3): stored, mixed, or computed."""
        if (known := self._stored(weights)) is not None:
            return known
        bare, coated = self._stored(BARE), self._stored(COATED)
        if bare is not None and coated is not None:
            return mixed(bare, coated, weights)
        return irradiance_map(self.picture, weights)

    def _stored(self, weights: NDArray[np.float64]) -> NDArray[np.float32] | None:
        same = (one.image for one in self.irradiances if np.allclose(one.weights, weights, rtol=_SAME, atol=_SAME))
        return next(same, None)

    def for_all_materials(self) -> Light:
        """Return the environment with what any material needs that reflects no light without extent.

        All levels of the pyramid, and the irradiance maps of both cosine lobes, of which every matte lobe is a mixture.
        """
        return self.with_tables(glossy=True, matte=[COATED, BARE])


def _red(image: NDArray[Any]) -> NDArray[Any]:
    return np.repeat(image[..., :1], 3, axis=-1)


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
    scene, width = backend.load({"type": "scene", "light": environment.emitter()}), environment.width
    image, frame, draws = environment.image, environment.frame, _draws(scene)
    delta = draws.delta_lights()
    if not with_image:
        return Light(_picture(scene, draws, width, RESOLUTION), delta=delta)
    if image is None or frame is None or min(image.shape[0] - 1, image.shape[1]) < _LEAST_COLUMNS:
        return Light(_picture(scene, draws, width, DELTA_RESOLUTION), delta=delta)
    return Light(_picture(scene, draws, width, RESOLUTION), image, frame, delta=delta)


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
        Radiance [W sr⁻¹ m⁻²]; see `rsibr.geometry.projections.octahedral`. Delta lights are not in it.

    Notes
    -----
    Sample points on a grid, except in sources of fewer than `_POINTS_OF_A_SOURCE` of them, such as the sun's disc or a
    lamp of few texels: these are drawn from the emitter. The density of the emitter tells the two apart, so that each
    direction counts in one of them.
    """
    scene = backend.load({"type": "scene", "light": emitter})
    return _picture(scene, _draws(scene), width, resolution)


def _draws(scene: mi.Scene) -> EmitterDraws:
    return EmitterDraws.where_needed(scene, _source_density(_POINTS * RESOLUTION))


def _source_density(points: int) -> float:
    """Density [sr⁻¹] of drawing a source of `_POINTS_OF_A_SOURCE`, with so many points along a side of the picture."""
    return points**2 / (4 * math.pi * _POINTS_OF_A_SOURCE)


def _picture(scene: mi.Scene, draws: EmitterDraws, width: int, resolution: int) -> NDArray[np.float32]:
    """See `light_map`."""
    # ---- Sample points a side of a texel, and the density of an emitter that a source of few points has ----
    finer = math.ceil(_POINTS * width / (math.sqrt(math.pi) * resolution))  # a texel's angle over 2π/width
    points = min(max(_POINTS, finer), _MOST_POINTS)
    environment = scene.environment()  # None if a delta light is all there is
    dense = 0.0 if environment is None else _source_density(max(points * resolution, _POINTS * RESOLUTION))
    has_small = draws.has_sources_denser_than(dense)
    small = draws.mean_radiance(resolution, dense) if has_small else np.zeros((resolution, resolution, 3))
    if environment is None:
        return np.asarray(small, dtype=np.float32)
    # ---- The rest on the grid; one pass a sample, to bound the memory ----
    total = dr.zeros(mi.Color3f, resolution**2)  # a constant emitter returns one lane for all
    offsets = (np.arange(points) + 0.5) / points
    for right in offsets:
        for down in offsets:
            d = texel_directions(resolution, float(right), float(down))
            radiance = _radiance(environment, d)
            total += dr.select(_density(environment, d) > dense, 0, radiance) if has_small else radiance
            dr.eval(total)
    even = np.array(total / points**2, dtype=np.float32).T.reshape(resolution, resolution, 3)
    return np.asarray(even + small, dtype=np.float32)


def _density(environment: mi.Emitter, d: mi.Vector3f) -> mi.Float:
    """Density [sr⁻¹] with which the emitter is drawn from in the direction `d`."""
    direction = dr.zeros(mi.DirectionSample3f, dr.width(d))
    direction.d = d
    return environment.pdf_direction(dr.zeros(mi.SurfaceInteraction3f, dr.width(d)), direction)


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

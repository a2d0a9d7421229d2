"""Directions drawn from an emitter: they find what points on a grid miss, small sources and delta lights."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.projections.octahedral import square_from_direction, texel_solid_angles
from rsibr.light.delta_lights import DeltaLights
from rsibr.scene.wavelengths import Wavelengths

SIDE = 1024
"""Strata a side of the random numbers: 2²⁰ draws."""

SCOUT_SIDE = 128
"""Strata a side of a first look, which costs little where an emitter has no small source."""

MOST_DELTA_LIGHTS = 64
"""Number of delta lights up to which a light is stored; each costs a loop over the lobes in every texel."""

_APART = 1e-6
"""Distance of two unit vectors up to which they are one delta light."""

_SEED = 0x6C69676874 % 2**32  # the letters "ight"; no random number is shared with a bake


@dataclass(frozen=True, eq=False)
class EmitterDraws:
    """Independent, stratified draws of `sample_direction`; E[weight] is the integral of the radiance over the sphere.

    Attributes
    ----------
    directions : ndarray, shape (M, 3)
        Unit directions to the light.
    weights : ndarray, shape (M, 3)
        Radiance over density [W m⁻²], linear Rec.709; of a delta light its irradiance over its probability.
    densities : ndarray, shape (M,)
        Density [sr⁻¹]; of a delta light its probability.
    is_delta : ndarray of bool, shape (M,)
        Whether a draw is of a delta light.
    """

    directions: NDArray[np.float64]
    weights: NDArray[np.float64]
    densities: NDArray[np.float64]
    is_delta: NDArray[np.bool_]

    @classmethod
    def of(cls, scene: mi.Scene, side: int = SIDE) -> EmitterDraws:
        """Draw from the only emitter of a scene, in the current variant; the same draws for the same scene.

        Parameters
        ----------
        scene : mi.Scene
            Scene with one emitter.
        side : int
            Strata a side of the random numbers.
        """
        # ---- Jittered strata for the direction, the wavelengths along a diagonal of the strata ----
        lanes, across = side**2, dr.opaque(mi.UInt32, side)
        index = dr.arange(mi.UInt32, lanes)
        random = mi.PCG32(size=lanes, initstate=mi.UInt64(_SEED))
        jitter = mi.Point2f(random.next_float32(), random.next_float32())
        column, row = index % across, index // across
        u = (mi.Point2f(mi.Float(column), mi.Float(row)) + jitter) / mi.Float(across)
        shift = (mi.Float((column + row) % across) + random.next_float32()) / mi.Float(across)
        wavelengths = Wavelengths.drawn(lambda: shift)
        # ---- Draws, in linear RGB ----
        point = dr.zeros(mi.SurfaceInteraction3f, lanes)
        point.wavelengths = wavelengths.nm
        drawn, weight = scene.sample_emitter_direction(point, u, test_visibility=False)
        seen = wavelengths.seen(mi.unpolarized_spectrum(weight) * wavelengths.weight)
        found = dr.select(~(drawn.pdf <= 0), seen, 0)  # a density of zero means no sample
        return cls(
            _rows(drawn.d, 3, lanes).astype(np.float64),
            _rows(found, 3, lanes).astype(np.float64),
            _rows(drawn.pdf, 1, lanes)[:, 0].astype(np.float64),
            _rows(dr.select(drawn.delta, mi.Float(1), mi.Float(0)), 1, lanes)[:, 0] > 0,
        )

    @classmethod
    def where_needed(cls, scene: mi.Scene, density: float) -> EmitterDraws:
        """As `of`; only `SCOUT_SIDE`² draws if those find neither a delta light nor a source denser than `density`."""
        scouts = cls.of(scene, SCOUT_SIDE)
        return cls.of(scene) if scouts.is_delta.any() or scouts.has_sources_denser_than(density) else scouts

    def delta_lights(self) -> DeltaLights:
        """Delta lights among the draws.

        Raises
        ------
        InputError
            If there are more than `MOST_DELTA_LIGHTS`.
        """
        rest = self.is_delta & self.weights.any(axis=1)
        directions, irradiance = list[NDArray[np.float64]](), list[NDArray[np.float64]]()
        while rest.any():
            if len(directions) == MOST_DELTA_LIGHTS:
                raise InputError(
                    f"has more than {MOST_DELTA_LIGHTS} lights without extent",
                    where="environment",
                    fix="give them an extent, as an envmap does",
                )
            toward = self.directions[int(rest.argmax())]
            same = rest & (np.abs(self.directions - toward).max(axis=1) <= _APART)
            directions.append(toward / np.linalg.norm(toward))
            irradiance.append(self.weights[same].sum(axis=0) / len(same))
            rest &= ~same
        if not directions:
            return DeltaLights.none()
        return DeltaLights(np.stack(directions).astype(np.float32), np.stack(irradiance).astype(np.float32))

    def has_sources_denser_than(self, density: float) -> bool:
        """Whether a draw that is no delta light has a density [sr⁻¹] above `density`."""
        return bool(self._denser_than(density).any())

    def mean_radiance(self, resolution: int, density: float) -> NDArray[np.float64]:
        """Mean radiance over octahedral texels of the sources denser than `density`.

        Parameters
        ----------
        resolution : int
            Texels a side, R.
        density : float
            Density [sr⁻¹] above which a draw counts. Delta lights never do.

        Returns
        -------
        ndarray, shape (R, R, 3)
            Radiance [W sr⁻¹ m⁻²]; its integral is an unbiased estimate of that of these sources.
        """
        chosen = self._denser_than(density)
        p = square_from_direction(mi.Vector3f(self.directions[chosen].T.astype(np.float32)))
        column, row = (np.clip(((np.array(x) + 1) * resolution / 2).astype(int), 0, resolution - 1) for x in (p.x, p.y))
        texel, texels = row * resolution + column, resolution**2
        power = np.stack([np.bincount(texel, w, texels) for w in self.weights[chosen].T], axis=1) / len(chosen)
        return (power / texel_solid_angles(resolution)[:, None]).reshape(resolution, resolution, 3)

    def _denser_than(self, density: float) -> NDArray[np.bool_]:
        return ~self.is_delta & (self.densities > density)


def _rows(value: object, channels: int, lanes: int) -> NDArray[np.float32]:
    """Values of all lanes, shape (lanes, channels), also where Dr.Jit holds one lane for all."""
    flat = np.array(value, dtype=np.float32).reshape(channels, -1).T
    return np.broadcast_to(flat, (lanes, channels))

"""Statistics of the environment: variance, colour, small sources, power a harmonic band."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.latlong import MITSUBA
from rsibr.geometry.projections.sphere_image import texel_directions, texel_solid_angles
from rsibr.light.emitter_draws import SCOUT_SIDE, EmitterDraws
from rsibr.light.harmonics import LMAX, band_power, coefficients, reduced

SMALL = 1e-3
"""Share of the sphere up to which a source counts as small; the sun has 5e-6, a studio lamp about 1e-2."""

UNRESOLVED = 1e9
"""Sentinel for the relative variance of a source without extent, such as a `directional` emitter."""

_ROWS, _COLUMNS = 256, 512
_DRAWS = 2**14
_MISSED = 0.01  # share of the power missed by the grid above which a small source is searched for


@dataclass(frozen=True, eq=False)
class LightProbe:
    """Statistics of the environment's radiance L, uniform over the sphere of directions.

    Attributes
    ----------
    mean : tuple of three floats
        Mean radiance [W sr⁻¹ m⁻²] in red, green, blue, without sources that have no extent.
    variance : float
        Relative variance of the radiance, ⟨L²⟩/⟨L⟩² − 1 of the mean of the channels: 0 for a constant sky;
        `UNRESOLVED` where a source has no extent.
    contrast : float
        Largest radiance over the mean.
    peak_share : float
        Share of the light that comes from the brightest `SMALL` of the sphere.
    chroma : float
        Root mean square of the difference of green and blue from red, relative to that of L: 0 for grey light.
    bands : ndarray, shape (LMAX + 1,)
        Share of ⟨L²⟩ in each band of spherical harmonics; the sum is at most 1.
    spectrum : ndarray, shape (LMAX + 1, LMAX + 1), complex
        Spherical-harmonic coefficients, m ≥ 0, of the mean of the channels, relative to its mean; see
        `rsibr.light.harmonics`.
    small : ndarray, shape (h, w)
        Mean of the channels, relative to its mean, at most 128 × 256 texels.
    """

    mean: tuple[float, float, float]
    variance: float
    contrast: float
    peak_share: float
    chroma: float
    bands: NDArray[np.float64] = field(repr=False)
    spectrum: NDArray[np.complex128] = field(repr=False)
    small: NDArray[np.float64] = field(repr=False)

    @property
    def beyond(self) -> float:
        """Share of ⟨L²⟩ beyond band `LMAX`."""
        return max(0.0, 1.0 - float(self.bands.sum()))

    @property
    def is_black(self) -> bool:
        """Whether there is no light at all."""
        return not any(self.mean) and not self.is_delta

    @property
    def is_delta(self) -> bool:
        """Whether the light comes from sources without extent."""
        return self.variance == UNRESOLVED


def probe_light(emitter: dict[str, Any], image: NDArray[np.float32] | None) -> LightProbe:
    """Measure the statistics of an environment.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity.
    image : ndarray (H, W, 3), or None
        Its latitude–longitude map in Mitsuba's layout, rows from pole to pole; None if it is not a map.

    Returns
    -------
    LightProbe

    Notes
    -----
    An emitter that is not a map is evaluated on a grid of directions. Power missed by the grid, such as that of a sun
    of 0.5°, is found by sampling the emitter and added to the texel of its direction.
    """
    if image is not None:
        return _statistics(image)
    scene = backend.load({"type": "scene", "light": emitter})
    if mi.has_flag(scene.emitters()[0].flags(), mi.EmitterFlags.Delta):
        return _of_delta_lights(scene)
    return _statistics(_without_losses(scene, _on_grid(scene)))


def _statistics(image: NDArray[np.float32]) -> LightProbe:
    # Mean and variance over the sphere, by solid angle
    brightest = float(image.max(initial=0.0))
    smaller = reduced(image, _ROWS, _COLUMNS) if image.shape[0] > 4 * _ROWS else image.astype(np.float64)
    weight = texel_solid_angles(MITSUBA, smaller.shape[:2])[0] / (4 * np.pi)
    mean = np.einsum("hw,hwc->c", weight, smaller)
    grey = smaller.mean(axis=2)
    level = float((weight * grey).sum())
    second = float((weight * grey**2).sum())
    if level <= 0:
        return _without_a_picture(0.0, 0.0, grey.shape)
    # Spherical harmonics, relative to the mean
    spectrum = coefficients(grey / level)
    return LightProbe(
        mean=(float(mean[0]), float(mean[1]), float(mean[2])),
        variance=min(max(0.0, second / level**2 - 1), UNRESOLVED),
        contrast=max(brightest, float(smaller.max())) / level,
        peak_share=_peak_share(grey, weight) / level,
        chroma=_chroma(smaller, weight),
        bands=band_power(spectrum) / max(second / level**2, 1e-30),
        spectrum=spectrum,
        small=reduced(grey[..., None] / level, _ROWS // 2, _COLUMNS // 2)[..., 0],
    )


def _of_delta_lights(scene: mi.Scene) -> LightProbe:
    """Statistics of lights without extent: none but their colour."""
    drawn = EmitterDraws.of(scene, SCOUT_SIDE)
    chroma = _chroma(drawn.weights[None], np.full((1, len(drawn.weights)), 1 / len(drawn.weights)))
    return _without_a_picture(UNRESOLVED if drawn.weights.any() else 0.0, chroma, (_ROWS, _COLUMNS))


def _without_a_picture(variance: float, chroma: float, shape: tuple[int, ...]) -> LightProbe:
    bands, spectrum = np.zeros(LMAX + 1), np.zeros((LMAX + 1, LMAX + 1), dtype=np.complex128)
    return LightProbe((0.0, 0.0, 0.0), variance, 0.0, 0.0, chroma, bands, spectrum, np.zeros(shape))


def _peak_share(grey: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    """Share of the light from the brightest `SMALL` of the sphere; the last texel counts in part."""
    order = np.argsort(grey, axis=None)[::-1]
    weights = weight.ravel()[order]
    before = np.cumsum(weights) - weights
    taken = np.clip(SMALL - before, 0, weights)
    return float((taken * grey.ravel()[order]).sum())


def _chroma(image: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    """Difference of green and blue from red, by their root mean square, relative to that of the radiance."""
    difference = ((image[..., 1:] - image[..., :1]) ** 2).max(axis=2)
    return float(np.sqrt((weight * difference).sum() / max((weight * image.max(axis=2) ** 2).sum(), 1e-300)))


def _on_grid(scene: mi.Scene) -> NDArray[np.float32]:
    """Radiance on a latitude–longitude grid, shape (H, W, 3), without sources that have no extent."""
    environment = scene.environment()
    if environment is None:
        return np.zeros((_ROWS, _COLUMNS, 3), dtype=np.float32)
    si = dr.zeros(mi.SurfaceInteraction3f, _ROWS * _COLUMNS)
    si.wi = -texel_directions(MITSUBA, (_ROWS, _COLUMNS))
    values = np.array(environment.eval(si), dtype=np.float32).reshape(3, -1).T
    return np.ascontiguousarray(np.broadcast_to(values, (_ROWS * _COLUMNS, 3))).reshape(_ROWS, _COLUMNS, 3)


def _without_losses(scene: mi.Scene, grid: NDArray[np.float32]) -> NDArray[np.float32]:
    """Add the power missed by the grid to the texel of the brightest sampled direction."""
    u = mi.Point2f(*dr.meshgrid(*[(dr.arange(mi.Float, int(_DRAWS**0.5)) + 0.5) / _DRAWS**0.5] * 2))
    drawn, weight = scene.sample_emitter_direction(dr.zeros(mi.Interaction3f, dr.width(u)), u, False)
    weights = np.array(weight, dtype=np.float64).reshape(3, -1)
    power = weights.mean(axis=1)
    solid = texel_solid_angles(MITSUBA, (_ROWS, _COLUMNS))[0]
    missing = power - np.einsum("hw,hwc->c", solid, grid)
    if scene.environment() is None or missing.sum() <= _MISSED * power.sum():
        return grid
    radiance = weights.sum(axis=0) * np.broadcast_to(np.array(drawn.pdf, dtype=np.float64), weights.shape[1])
    brightest = mi.Vector3f(np.array(drawn.d, dtype=np.float32).reshape(3, -1)[:, [int(radiance.argmax())]])
    texel = int(np.array(MITSUBA.texel_of(brightest, *MITSUBA.axes((_ROWS, _COLUMNS)))).item())
    whole = grid.copy()
    whole.reshape(-1, 3)[texel] += np.maximum(missing, 0) / solid.ravel()[texel]
    return whole

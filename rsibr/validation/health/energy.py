"""Energy drift: a view whose map holds more or less light than the other views and the environment say it should.

The mean over a whole map is the light that the sphere sends to that viewer. For an isotropic BRDF it is the environment
folded with one kernel of the angle between light and viewer, the same for every view:

    M(v) = ∫ L_i(ω) K(ω·v) dω = Σ_l k_l ∫ L_i(ω) P_l(ω·v) dω

The integrals over the environment are known and the few k_l are not: all views together determine them, and a view that
does not fit the others stands out, however much the means differ from view to view because the environment does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

Array = NDArray[np.float64]

FALSE_ALARMS = 1e-3
"""Chance that a bake without drift shows one, where what the kernel leaves unexplained is Gaussian."""

LEAST_DRIFT = 0.15
"""Relative deviation below which nothing is called a drift.

What few degrees leave unexplained is not quite Gaussian: of 20 sound bakes (the presets under four real maps, twelve
views) two exceed the level of `FALSE_ALARMS`, by 8 and 12 %.
"""

ERRORS = 5.0
"""Standard errors of the map's mean that a deviation must exceed."""

HIGHEST_DEGREE = 8
_VIEWS_A_DEGREE = 3
_FAINT = 0.01
_SIDE = 256
_CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class Drift:
    """A view out of line with the others.

    Attributes
    ----------
    view : int
        Index of the stored view.
    channel : str
        `"red"`, `"green"` or `"blue"`.
    ratio : float
        Mean radiance of its map over what the other views predict.
    p_value : float
        Probability of so large a deviation, two-sided, before Šidák's correction.
    """

    view: int
    channel: str
    ratio: float
    p_value: float


@dataclass(frozen=True, eq=False)
class MapMeans:
    """Mean radiance of each map over the disk.

    Attributes
    ----------
    mean, error : ndarray, shape (V, 3)
        Mean [W sr⁻¹ m⁻²] and its standard error.
    """

    mean: Array
    error: Array


def drifting_views(means: MapMeans, directions: Array, emitter: Mapping[str, Any]) -> list[Drift]:
    """Find the views whose mean does not fit the one kernel of all the others.

    Parameters
    ----------
    means : MapMeans
    directions : ndarray, shape (V, 3)
        Unit view directions.
    emitter : mapping
        Mitsuba emitter at infinity.

    Returns
    -------
    list of Drift
        In the order of the views. Empty where there are too few views to tell.

    Notes
    -----
    Least squares with each view left out in turn: externally studentised residuals, Student's t, Šidák over views and
    channels at `FALSE_ALARMS`. Degrees 0 to V/3 − 1 (at most `HIGHEST_DEGREE`). What the higher degrees hold, and any
    anisotropy of the BRDF, enters the residual of every view and makes the test less sharp. With twelve views, a drift
    of 30 % is seen in 17 of the 20 bakes named at `LEAST_DRIFT`: not where a tiny sun or a strip light is nearly all.
    """
    degree = min(HIGHEST_DEGREE, len(directions) // _VIEWS_A_DEGREE - 1)
    if degree < 0:
        return []
    moments = zonal_moments(emitter, directions, degree)
    level = 1 - (1 - FALSE_ALARMS) ** (1 / means.mean.size)
    found = []
    for channel, name in enumerate(_CHANNELS):
        predicted, p_values = _left_out(moments[:, :, channel], means.mean[:, channel])
        deviation = np.abs(means.mean[:, channel] - predicted)
        large = deviation > np.maximum(LEAST_DRIFT * np.abs(predicted), ERRORS * means.error[:, channel])
        for view in np.flatnonzero(large & (p_values < level) & (predicted > 0)):
            ratio = float(means.mean[view, channel] / predicted[view])
            found.append(Drift(int(view), name, ratio, float(p_values[view])))
    return sorted(found, key=lambda drift: drift.view)


def zonal_moments(emitter: Mapping[str, Any], directions: Array, degree: int) -> Array:
    """Integrals of the environment against Legendre polynomials about each view: ∫ L_i(ω) P_l(ω·v) dω.

    Parameters
    ----------
    emitter : mapping
        Mitsuba emitter at infinity.
    directions : ndarray, shape (V, 3)
        The v.
    degree : int
        Largest l.

    Returns
    -------
    ndarray, shape (V, degree + 1, 3)
        From 65 536 stratified directions, drawn as the emitter does: relative error about 1e-3.
    """
    light, weight = _light_samples(emitter)
    vander = (np.polynomial.legendre.legvander(light @ v, degree) for v in directions)
    return np.stack([values.T @ weight / len(weight) for values in vander])


def mean_of_map(radiance: Array, variance: Array, coverage: Array) -> tuple[Array, Array]:
    """Mean of a map over its covered area, and its standard error, a channel each.

    Parameters
    ----------
    radiance, variance : ndarray, shape (K, 3)
        Texels that can be judged.
    coverage : ndarray, shape (K,)

    Returns
    -------
    mean, error : ndarray, shape (3,)
        Zero where there is no texel.
    """
    total = max(float(coverage.sum()), np.finfo(np.float64).tiny)
    return coverage @ radiance / total, np.sqrt(coverage**2 @ variance) / total


def _light_samples(emitter: Mapping[str, Any]) -> tuple[Array, Array]:
    """Directions (n, 3) toward the light, and radiance over density (n, 3)."""
    scene = mi.load_dict({"type": "scene", "light": dict(emitter)})
    index = dr.arange(mi.UInt32, _SIDE**2)
    generator = mi.PCG32(size=_SIDE**2)
    jitter = mi.Point2f(generator.next_float32(), generator.next_float32())
    square = (mi.Point2f(index % _SIDE, index // _SIDE) + jitter) / _SIDE
    point = dr.zeros(mi.SurfaceInteraction3f, _SIDE**2)
    sample, weight = scene.sample_emitter_direction(point, square, test_visibility=False)
    return np.array(sample.d, dtype=np.float64).T, np.array(weight, dtype=np.float64).T


def _left_out(moments: Array, means: Array) -> tuple[Array, Array]:
    """Prediction of each view from the others, and the two-sided p-value of its deviation; shapes (V,)."""
    size = np.sqrt((moments**2).mean(axis=0))
    used = moments[:, size > _FAINT * size[0]]  # under a constant sky the higher degrees are all noise
    unitary = np.linalg.qr(used)[0] if used.size else used
    hat = unitary @ unitary.T
    freedom = len(means) - used.shape[1] - 1
    residual = means - hat @ means
    leverage = np.minimum(np.diag(hat), 1 - 1e-9)
    spread = np.maximum((residual**2).sum() - residual**2 / (1 - leverage), 0.0) / max(freedom, 1)
    scale = np.sqrt(spread * (1 - leverage))
    statistic = np.divide(np.abs(residual), scale, out=np.zeros_like(means), where=scale > 0)
    statistic[(scale == 0) & (residual != 0)] = np.inf
    return means - residual / (1 - leverage), 2 * student_t.sf(statistic, max(freedom, 1))

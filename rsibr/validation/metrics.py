"""Error metrics of a sphere map against a path-traced reference, for one method at one view.

The main metric is relMSE, with the noise of the reference subtracted, and with a confidence interval. SMAPE, HDR-FLIP,
the energy ratio and the worst texel are always reported too, because no single metric shows every kind of error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import CheckFailed
from rsibr.store.noise import COVERED, denominator
from rsibr.validation.estimate import Estimate, jackknife, mean_estimate
from rsibr.validation.flip import Exposures, exposures_for, flip_map
from rsibr.validation.reference import Reference

ZONES: dict[str, tuple[float, float]] = {"inner": (0.0, 2 / 3), "middle": (2 / 3, 0.9), "rim": (0.9, np.inf)}
"""Zones by radius of the texel centres in the unit disk; errors of warps are largest at the rim."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WorstTexel:
    """Texel with the largest relative squared error.

    Attributes
    ----------
    s, t : float
        Centre of the texel in the sphere map, s right, t up, in (0, 1).
    error : float
        Relative squared error, mean over channels, including the noise of the reference.
    """

    s: float
    t: float
    error: float


@dataclass(frozen=True, eq=False)
class MapError:
    """All metrics of one map.

    Attributes
    ----------
    rel_mse : Estimate
        Mean of (a−b)²/(b²+ε) over texels and channels, with ε = (0.1·mean b)² for each channel, and the noise of the
        reference subtracted.
    rel_mse_channels : tuple of three Estimate
        The same for red, green and blue.
    rel_mse_zones : dict of str to Estimate
        The same for each of `ZONES` that contains a texel.
    noise_floor : float
        RelMSE of a perfect map due to the noise of the reference, if it were not subtracted.
    smape : float
        Mean of |a−b|/(|a|+|b|), in [0, 1].
    flip : float
        Mean HDR-FLIP, in [0, 1].
    energy_ratio : float or None
        Σa/Σb weighted by coverage, mean over channels; None if a channel is black in the reference only.
    worst_texel : WorstTexel
        Texel with the largest relative squared error.
    relative_error : ndarray, shape (H, W)
        Square root of the relative squared error of each texel, mean over channels; NaN where coverage < ½.
    flip_map : ndarray, shape (H, W)
        HDR-FLIP of each texel; NaN where coverage < ½.
    """

    rel_mse: Estimate
    rel_mse_channels: tuple[Estimate, Estimate, Estimate]
    rel_mse_zones: dict[str, Estimate]
    noise_floor: float
    smape: float
    flip: float
    energy_ratio: float | None
    worst_texel: WorstTexel
    relative_error: NDArray[np.float32]
    flip_map: NDArray[np.float32]


def compare(
    candidate: NDArray[np.floating],
    reference: Reference,
    exposures: Exposures | None = None,
    name: str = "candidate",
    zones: Mapping[str, NDArray[np.bool_]] | None = None,
) -> MapError:
    """Compare a map, or a picture of an object, with a path-traced reference.

    Parameters
    ----------
    candidate : ndarray, shape (H, W, 3)
        Radiance, scene-linear, coverage divided out. Texels without coverage are ignored.
    reference : Reference
        Reference of the same view and resolution, with at least three buffers.
    exposures : Exposures, optional
        Exposures of FLIP from `exposures_for`; the same for all views and methods whose FLIP is compared. By default
        around the mean of this reference.
    name : str
        Name of the candidate in error messages.
    zones : mapping of str to ndarray of bool, shape (H, W), optional
        Zones of the image; by default `ZONES` by radius.

    Returns
    -------
    MapError

    Raises
    ------
    CheckFailed
        If the candidate or a buffer has NaN or Inf in a texel with coverage.
    ValueError
        If shapes differ or there are fewer than three buffers.
    """
    if candidate.shape != reference.buffers.shape[1:] or len(reference.buffers) < 3:
        raise ValueError(f"cannot compare {candidate.shape} with buffers {reference.buffers.shape}")
    _check_finite(candidate, reference, name)
    judged = reference.coverage >= COVERED
    weights = reference.coverage[judged].astype(np.float64)
    a = candidate[judged].astype(np.float64)
    buffers = reference.buffers[:, judged].astype(np.float64)
    b = buffers.mean(axis=0)

    squared = (a - b) ** 2 / denominator(b)
    judged_zones = _zones(judged) if zones is None else within(zones, judged)
    all_channels, channels, by_zone = _relative_mse(a, buffers, judged_zones)
    exposures = exposures or exposures_for(float(reference.mean[judged].mean()))
    perceived = _masked(flip_map(_only(reference.mean, judged), _only(candidate, judged), exposures), judged)
    return MapError(
        rel_mse=all_channels,
        rel_mse_channels=channels,
        rel_mse_zones=by_zone,
        noise_floor=noise_floor(reference),
        smape=float(smape_of_texels(a, b).mean()),
        flip=float(np.nanmean(perceived)),
        energy_ratio=energy_ratio_of(a, b, weights),
        worst_texel=_worst_texel(squared.mean(axis=1), judged),
        relative_error=_spread_out(np.sqrt(squared.mean(axis=1)), judged),
        flip_map=perceived,
    )


def relative_mse_of_samples(samples: Array, buffers: Array) -> Estimate:
    """Debiased relMSE of the mean of independent samples.

    Parameters
    ----------
    samples : ndarray, shape (S, T, 3)
        Independent samples of each texel, S ≥ 3.
    buffers : ndarray, shape (K, T, 3)
        Independent buffers of the reference, K ≥ 3.

    Returns
    -------
    Estimate
        Mean over texels and channels of ((ā − R̄)² − s_a²/S − s²/K) / (R̄² + ε): the variance of the samples and the
        noise of the reference are both subtracted. The standard error combines both, by the jackknife.
    """

    def value(a: _Moments, b: _Moments) -> float:
        return float((((a.mean - b.mean) ** 2 - a.variance - b.variance) / denominator(b.mean)).mean())

    a, b = _Moments.of(samples), _Moments.of(buffers)
    whole = value(a, b)
    over_buffers = jackknife(whole, np.array([value(a, rest) for rest in _Moments.leaving_out_each(buffers)]))
    over_samples = jackknife(whole, np.array([value(rest, b) for rest in _Moments.leaving_out_each(samples)]))
    both = mean_estimate([over_buffers, over_samples])  # of two estimates: half the joint standard error
    return Estimate(over_buffers.value, 2 * both.standard_error, both.degrees_of_freedom)


def noise_floor(reference: Reference) -> float:
    """Expected relMSE of a perfect map against this reference, if the noise were not subtracted.

    Multiplied by `reference.samples` it is the relative variance of one sample of the path tracer, from which the time
    of path tracing to a given error follows.
    """
    return float(np.mean(_relative_noise(reference)))


def zone_shares(reference: Reference) -> dict[str, float]:
    """Share of the texels with coverage ≥ ½ in each of `ZONES`: weights with which their errors sum up to the map's."""
    return {name: float(inside.mean()) for name, inside in _zones(reference.coverage >= COVERED).items()}


def relative_noise_map(reference: Reference) -> NDArray[np.float32]:
    """Relative standard deviation of the reference, shape (H, W), on the scale of `MapError.relative_error`."""
    judged = reference.coverage >= COVERED
    return _spread_out(np.sqrt(_relative_noise(reference).mean(axis=1)), judged)


def _relative_noise(reference: Reference) -> Array:
    moments = _Moments.of(reference.buffers[:, reference.coverage >= COVERED].astype(np.float64))
    return np.asarray(moments.variance / denominator(moments.mean))


@dataclass(frozen=True, eq=False)
class _Moments:
    """Mean of the buffers, and variance of that mean, for each texel with coverage ≥ ½ and each channel."""

    mean: Array
    variance: Array

    @staticmethod
    def of(buffers: Array) -> _Moments:
        return _Moments(buffers.mean(axis=0), buffers.var(axis=0, ddof=1) / len(buffers))

    @staticmethod
    def leaving_out_each(buffers: Array) -> Iterator[_Moments]:
        """Yield the moments without each buffer in turn, by downdating the sums."""
        k = len(buffers)
        mean = buffers.mean(axis=0)
        squares = ((buffers - mean) ** 2).sum(axis=0)
        for buffer in buffers:
            deviation = buffer - mean
            rest = np.maximum(squares - deviation**2 * k / (k - 1), 0.0)
            yield _Moments(mean - deviation / (k - 1), rest / ((k - 2) * (k - 1)))


def _relative_mse(
    a: Array, buffers: Array, zones: Mapping[str, NDArray[np.bool_]]
) -> tuple[Estimate, tuple[Estimate, Estimate, Estimate], dict[str, Estimate]]:
    """Debiased relMSE of the map, of each channel and of each zone, with intervals by the jackknife."""
    zones = {name: inside for name, inside in zones.items() if inside.any()}

    def averages(moments: _Moments) -> Array:
        texels = _debiased(a, moments)
        return np.array([texels.mean(), *texels.mean(axis=0), *(texels[inside].mean() for inside in zones.values())])

    values = averages(_Moments.of(buffers))
    left_out = np.array([averages(moments) for moments in _Moments.leaving_out_each(buffers)])
    every, red, green, blue, *by_zone = (jackknife(float(v), left_out[:, i]) for i, v in enumerate(values))
    return every, (red, green, blue), dict(zip(zones, by_zone, strict=True))


def _debiased(a: Array, moments: _Moments) -> Array:
    """Relative squared error of each texel and channel, minus the expected contribution of the reference's noise.

    E[(a − R̄)²] = (a − R)² + σ²/K, and s² of the same buffers is an unbiased estimate of σ². The remaining bias due to
    the noisy denominator (a few per cent of the value at 3 % noise) is removed by the jackknife.
    """
    return np.asarray(((a - moments.mean) ** 2 - moments.variance) / denominator(moments.mean))


def smape_of_texels(a: Array, b: Array) -> Array:
    """|a−b|/(|a|+|b|) of each texel and channel, in [0, 1]; 0 where both are black."""
    total = np.abs(a) + np.abs(b)
    return np.asarray(np.divide(np.abs(a - b), total, out=np.zeros_like(total), where=total > 0))


def energy_ratio_of(a: Array, b: Array, weights: Array) -> float | None:
    """Σa/Σb of texels, shape (T, 3), with weights of shape (T,), mean over channels; None if only b is black."""
    ours, theirs = weights @ a, weights @ b
    if ((theirs == 0) & (ours != 0)).any():
        return None
    return float(np.mean(np.divide(ours, theirs, out=np.ones(3), where=theirs != 0)))


def _worst_texel(error: Array, judged: NDArray[np.bool_]) -> WorstTexel:
    worst = int(np.argmax(error))
    row, column = (int(index[worst]) for index in np.nonzero(judged))
    height, width = judged.shape
    return WorstTexel(s=(column + 0.5) / width, t=1.0 - (row + 0.5) / height, error=float(error[worst]))


def within(zones: Mapping[str, NDArray[np.bool_]], judged: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Which of the judged texels lie in each zone of an image."""
    return {name: inside[judged] for name, inside in zones.items()}


def _zones(judged: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Which of the texels with coverage ≥ ½ lie in each zone."""
    radius = _radius(judged)
    return {name: (radius >= low) & (radius < high) for name, (low, high) in ZONES.items()}


def _radius(judged: NDArray[np.bool_]) -> Array:
    """Distance of the centres of texels with coverage ≥ ½ from the centre of the unit disk."""
    row, column = np.nonzero(judged)
    height, width = judged.shape
    return np.asarray(np.hypot((column + 0.5) * 2 / width - 1, (row + 0.5) * 2 / height - 1))


def _check_finite(candidate: NDArray[np.floating], reference: Reference, name: str) -> None:
    covered = reference.coverage > 0
    images = [(name, candidate), *((f"reference, buffer {k}", image) for k, image in enumerate(reference.buffers))]
    for label, image in images:
        bad = np.argwhere(covered[..., None] & ~np.isfinite(image))
        if len(bad):
            row, column, channel = bad[0]
            value = image[row, column, channel]
            raise CheckFailed(
                f"radiance is {value} ({len(bad)} such values in all)",
                where=f"{label}, row {row}, column {column}, channel {'RGB'[channel]}",
                fix="find its cause: such values are never averaged",
            )


def _only(image: NDArray[np.floating], judged: NDArray[np.bool_]) -> NDArray[np.floating]:
    return np.where(judged[..., None], image, 0.0)


def _masked(values: NDArray[np.float32], judged: NDArray[np.bool_]) -> NDArray[np.float32]:
    return np.where(judged, values, np.float32(np.nan))


def _spread_out(values: Array, judged: NDArray[np.bool_]) -> NDArray[np.float32]:
    picture = np.full(judged.shape, np.nan, dtype=np.float32)
    picture[judged] = np.minimum(values, np.finfo(np.float32).max)
    return picture

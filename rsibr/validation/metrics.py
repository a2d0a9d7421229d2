"""How far a sphere map is from the truth: the numbers of one method at one view.

relMSE is the headline, debiased of the reference's noise and with a confidence interval. No number sees everything, so
SMAPE, HDR-FLIP, the energy ratio and the worst texel stand beside it always.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import CheckFailed
from rsibr.store.noise import COVERED, denominator
from rsibr.validation.estimate import Estimate, jackknife, mean_estimate
from rsibr.validation.flip import Exposures, flip_map
from rsibr.validation.reference import Reference

ZONES: dict[str, tuple[float, float]] = {"inner": (0.0, 2 / 3), "middle": (2 / 3, 0.9), "rim": (0.9, np.inf)}
"""Radii of the texel centres in the unit disk: the error of a warp lives at the rim."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WorstTexel:
    """The texel with the largest relative squared error.

    Attributes
    ----------
    s, t : float
        Its centre in the sphere map, s right, t up, in (0, 1).
    error : float
        Its relative squared error, mean over the channels, noise included.
    """

    s: float
    t: float
    error: float


@dataclass(frozen=True, eq=False)
class MapError:
    """Everything said about one map.

    Attributes
    ----------
    rel_mse : Estimate
        Mean of (a−b)²/(b²+ε) over texels and channels, ε = (0.1·mean b)² a channel, the reference's noise taken out.
    rel_mse_channels : tuple of three Estimate
        The same for red, green and blue.
    rel_mse_zones : dict of str to Estimate
        The same for each of `ZONES` that holds a texel.
    noise_floor : float
        relMSE that the noise of the reference alone would show.
    smape : float
        Mean of |a−b|/(|a|+|b|), in [0, 1].
    flip : float
        Mean HDR-FLIP, in [0, 1].
    energy_ratio : float or None
        Σa/Σb weighted by coverage, mean over the channels; None where light appears in a black channel.
    worst_texel : WorstTexel
    relative_error : ndarray, shape (H, W)
        Square root of the relative squared error of each texel, mean over the channels; NaN where nothing is judged.
    flip_map : ndarray, shape (H, W)
        HDR-FLIP of each texel; NaN where nothing is judged.
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
    candidate: NDArray[np.floating], reference: Reference, exposures: Exposures, name: str = "candidate"
) -> MapError:
    """Judge a map against path-traced truth.

    Parameters
    ----------
    candidate : ndarray, shape (H, W, 3)
        Radiance, scene-linear, coverage divided out. What lies in texels without coverage is ignored.
    reference : Reference
        Of the same view and resolution, with three buffers at least.
    exposures : Exposures
        The same for all views and methods that are to be compared: `exposures_for`.
    name : str
        Who made the candidate, for the error message.

    Returns
    -------
    MapError

    Raises
    ------
    CheckFailed
        If the candidate or a buffer holds NaN or Inf in a texel with coverage: never averaged away.
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
    all_channels, channels, zones = _relative_mse(a, buffers, judged)
    perceived = _masked(flip_map(_only(reference.mean, judged), _only(candidate, judged), exposures), judged)
    return MapError(
        rel_mse=all_channels,
        rel_mse_channels=channels,
        rel_mse_zones=zones,
        noise_floor=noise_floor(reference),
        smape=_smape(a, b),
        flip=float(np.nanmean(perceived)),
        energy_ratio=_energy_ratio(a, b, weights),
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
        Mean over texels and channels of ((ā − R̄)² − s_a²/S − s²/K) / (R̄² + ε): the scatter of the samples is taken out
        as the noise of the reference is. The standard error is that of both, from leaving each out in turn.
    """

    def value(a: _Moments, b: _Moments) -> float:
        return float((((a.mean - b.mean) ** 2 - a.variance - b.variance) / denominator(b.mean)).mean())

    a, b = _Moments.of(samples), _Moments.of(buffers)
    whole = value(a, b)
    over_buffers = jackknife(whole, np.array([value(a, rest) for rest in _Moments.leaving_out_each(buffers)]))
    over_samples = jackknife(whole, np.array([value(rest, b) for rest in _Moments.leaving_out_each(samples)]))
    both = mean_estimate([over_buffers, over_samples])  # of degrees of freedom and twice the standard error
    return Estimate(over_buffers.value, 2 * both.standard_error, both.degrees_of_freedom)


def noise_floor(reference: Reference) -> float:
    """Predict the relMSE of a perfect map against this reference, were the noise not taken out.

    Times `reference.samples` it is the path tracer's relative variance a sample: what error costs without a bake.
    """
    return float(np.mean(_relative_noise(reference)))


def relative_noise_map(reference: Reference) -> NDArray[np.float32]:
    """Relative standard deviation of the reference, shape (H, W), on the scale of `MapError.relative_error`."""
    judged = reference.coverage >= COVERED
    return _spread_out(np.sqrt(_relative_noise(reference).mean(axis=1)), judged)


def _relative_noise(reference: Reference) -> Array:
    moments = _Moments.of(reference.buffers[:, reference.coverage >= COVERED].astype(np.float64))
    return np.asarray(moments.variance / denominator(moments.mean))


@dataclass(frozen=True, eq=False)
class _Moments:
    """Mean of the buffers, and the variance of that mean, of each judged texel and channel."""

    mean: Array
    variance: Array

    @staticmethod
    def of(buffers: Array) -> _Moments:
        return _Moments(buffers.mean(axis=0), buffers.var(axis=0, ddof=1) / len(buffers))

    @staticmethod
    def leaving_out_each(buffers: Array) -> Iterator[_Moments]:
        """Moments of the other K − 1 buffers, for each in turn, from what it adds to the sums."""
        k = len(buffers)
        mean = buffers.mean(axis=0)
        squares = ((buffers - mean) ** 2).sum(axis=0)
        for buffer in buffers:
            deviation = buffer - mean
            rest = np.maximum(squares - deviation**2 * k / (k - 1), 0.0)
            yield _Moments(mean - deviation / (k - 1), rest / ((k - 2) * (k - 1)))


def _relative_mse(
    a: Array, buffers: Array, judged: NDArray[np.bool_]
) -> tuple[Estimate, tuple[Estimate, Estimate, Estimate], dict[str, Estimate]]:
    """Debiased relMSE over all, a channel and a zone, with intervals from leaving each buffer out in turn."""
    radius = _radius(judged)
    zones = {name: (radius >= low) & (radius < high) for name, (low, high) in ZONES.items()}
    zones = {name: inside for name, inside in zones.items() if inside.any()}

    def averages(moments: _Moments) -> Array:
        texels = _debiased(a, moments)
        return np.array([texels.mean(), *texels.mean(axis=0), *(texels[inside].mean() for inside in zones.values())])

    values = averages(_Moments.of(buffers))
    left_out = np.array([averages(moments) for moments in _Moments.leaving_out_each(buffers)])
    every, red, green, blue, *by_zone = (jackknife(float(v), left_out[:, i]) for i, v in enumerate(values))
    return every, (red, green, blue), dict(zip(zones, by_zone, strict=True))


def _debiased(a: Array, moments: _Moments) -> Array:
    """Relative squared error of each texel and channel, the expected share of the reference's noise taken out.

    E[(a − R̄)²] = (a − R)² + σ²/K, and s² is an unbiased estimate of σ² that the same buffers give. What bias the noise
    of the denominator leaves (a few per cent of the value at 3 % noise) the jackknife takes out.
    """
    return np.asarray(((a - moments.mean) ** 2 - moments.variance) / denominator(moments.mean))


def _smape(a: Array, b: Array) -> float:
    total = np.abs(a) + np.abs(b)
    return float(np.mean(np.divide(np.abs(a - b), total, out=np.zeros_like(total), where=total > 0)))


def _energy_ratio(a: Array, b: Array, weights: Array) -> float | None:
    ours, theirs = weights @ a, weights @ b
    if ((theirs == 0) & (ours != 0)).any():
        return None
    return float(np.mean(np.divide(ours, theirs, out=np.ones(3), where=theirs != 0)))


def _worst_texel(error: Array, judged: NDArray[np.bool_]) -> WorstTexel:
    worst = int(np.argmax(error))
    row, column = (int(index[worst]) for index in np.nonzero(judged))
    height, width = judged.shape
    return WorstTexel(s=(column + 0.5) / width, t=1.0 - (row + 0.5) / height, error=float(error[worst]))


def _radius(judged: NDArray[np.bool_]) -> Array:
    """Distance of the judged texels' centres from the middle of the unit disk."""
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
                fix="look for the cause: no average would hide it",
            )


def _only(image: NDArray[np.floating], judged: NDArray[np.bool_]) -> NDArray[np.floating]:
    return np.where(judged[..., None], image, 0.0)


def _masked(values: NDArray[np.float32], judged: NDArray[np.bool_]) -> NDArray[np.float32]:
    return np.where(judged, values, np.float32(np.nan))


def _spread_out(values: Array, judged: NDArray[np.bool_]) -> NDArray[np.float32]:
    picture = np.full(judged.shape, np.nan, dtype=np.float32)
    picture[judged] = np.minimum(values, np.finfo(np.float32).max)
    return picture

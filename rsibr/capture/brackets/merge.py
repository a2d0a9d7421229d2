"""Merge of exposure brackets by inverse variance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.brackets.hdr_image import HdrImage
from rsibr.capture.brackets.noise_model import NoiseModel
from rsibr.capture.brackets.one_size import check_one_size
from rsibr.capture.curves.curve import Curve
from rsibr.capture.curves.linear import LINEAR
from rsibr.capture.photographs.photograph import Photograph
from rsibr.errors import InputError

Array = NDArray[np.float64]

SATURATION = 0.985
"""Encoded value from which a channel counts as saturated: JPEG rings below its largest value."""

_PASSES = 3
"""Rounds in which the weights follow the merged radiance, not the noise of a single value."""

_SIGMAS = 4.0
"""Standard deviations that the expected exposure must keep from the ends of the range."""

_CONTRADICTION = 0.5
"""Share of the radiance that saturated one shot, below which another shot contradicts it."""

_STRIP = 2**21  # pixels at once


@dataclass(frozen=True, eq=False)
class _Shot:
    """One photograph, as the merge sees it."""

    photograph: Photograph
    curve: Curve
    amount: float


def merged(photographs: Sequence[Photograph], curve: Curve, noise: NoiseModel | None = None) -> HdrImage:
    """Merge photographs of one view.

    Each channel of a pixel is the mean of the shots' radiances, weighted by their inverse variance: the maximum
    likelihood for Gaussian noise. The variance comes from the merged radiance, not from the noisy value, which would
    favour what is too dark by chance. A shot in which the expected exposure comes near saturation takes no part, nor
    does one near black, if another sees more.

    Parameters
    ----------
    photographs : sequence of Photograph
        Aligned, of one size, each with its exposure; NaN where one shows nothing, which not all may do.
    curve : Curve
        Response of the camera; linear photographs have none.
    noise : NoiseModel, optional
        Of the camera.

    Returns
    -------
    HdrImage
        Radiance per `Exposure.amount`: 1 is what saturates an exposure of one second at f/1 and ISO 100. What is
        saturated in every photograph holds the radiance that just saturates the shortest, a lower bound; so does what
        was saturated in one and is far too dark in the others.

    Raises
    ------
    InputError
        If there is no photograph, an exposure is unknown, or sizes differ.
    """
    shots = _shots(photographs, curve)
    width, height = photographs[0].size
    rows = max(_STRIP // width, 1)
    strips = [_merged_rows(shots, slice(top, top + rows), noise or NoiseModel()) for top in range(0, height, rows)]
    radiance, variance, saturated = (np.concatenate(part) for part in zip(*strips, strict=True))
    return HdrImage(radiance.astype(np.float32), variance.astype(np.float32), saturated)


def _shots(photographs: Sequence[Photograph], curve: Curve) -> list[_Shot]:
    if not photographs:
        raise InputError("no photographs", where="shots", fix="name at least one file")
    check_one_size(photographs)
    shots = []
    for one in photographs:
        if one.exposure is None:
            raise InputError("has no exposure in its EXIF data", where=one.name, fix="give --exposures, one for each")
        shots.append(_Shot(one, LINEAR if one.is_linear else curve, one.exposure.amount))
    return shots


def _merged_rows(shots: Sequence[_Shot], rows: slice, noise: NoiseModel) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Radiance, variance and saturation of some rows."""
    values = np.stack([shot.photograph.values[rows] for shot in shots]).astype(np.float64)
    missing = np.isnan(values)
    values[missing] = 0.0
    bounded = np.array([bool(shot.photograph.levels) for shot in shots])[:, None, None, None]
    amounts = np.array([shot.amount for shot in shots])[:, None, None, None]
    exposures = np.stack([_linear(shot, one) for shot, one in zip(shots, values, strict=True)])
    steps = np.stack([_step(shot, one) for shot, one in zip(shots, values, strict=True)])
    saturated = (values >= SATURATION) & bounded
    ceiling = np.stack([_linear(shot, np.full((1, 1, 3), SATURATION)) for shot in shots])

    out = saturated | missing
    lost = out.all(axis=0)
    radiance = _first_guess(exposures, amounts, out)
    for _ in range(_PASSES):
        expected = radiance * amounts
        spread = noise.variance(expected, steps)
        usable = ~out & ((expected + _SIGMAS * np.sqrt(spread) < ceiling) | ~bounded)
        usable |= (~out & ~usable.any(axis=0)) & (amounts == _least_usable(amounts, out))
        seen = usable & (expected > _SIGMAS * np.sqrt(noise.variance(np.zeros(1), steps)))
        weights = np.where(np.where(seen.any(axis=0), seen, usable), amounts**2 / spread, 0.0)
        total = np.maximum(weights.sum(axis=0), 1e-300)
        radiance = np.maximum((weights * exposures / amounts).sum(axis=0) / total, 0.0)
    # A shot that says less than a saturated one allows saw something else: the sun moved, or the camera did
    least = np.where(saturated, ceiling / amounts, 0.0).max(axis=0)
    lost |= radiance < _CONTRADICTION * least
    return np.where(lost, least, radiance), np.where(lost, 0.0, 1 / total), lost


def _first_guess(exposures: Array, amounts: Array, out: NDArray[np.bool_]) -> Array:
    """Radiance from the longest exposure that is not out: saturated, or missing."""
    order = np.where(out, -np.inf, amounts)
    longest = np.argmax(order, axis=0)[None]
    return np.asarray(np.maximum(np.take_along_axis(exposures / amounts, longest, axis=0)[0], 0.0))


def _least_usable(amounts: Array, out: NDArray[np.bool_]) -> Array:
    """Least exposure in which each channel is not out: the farthest from saturation."""
    return np.asarray(np.where(out, np.inf, amounts).min(axis=0))


def _linear(shot: _Shot, values: Array) -> Array:
    return values if shot.photograph.is_linear else shot.curve.linear(values)


def _step(shot: _Shot, values: Array) -> Array:
    """Step of the file in units of exposure at each value."""
    levels = shot.photograph.levels
    if not levels:
        return np.zeros_like(values)
    return (np.ones_like(values) if shot.photograph.is_linear else shot.curve.slope(values)) / levels

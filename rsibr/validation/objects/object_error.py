"""Errors of a picture against one truth, each with its interval, for the whole and for each zone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.store.noise import COVERED
from rsibr.validation.estimate import Estimate, jackknife
from rsibr.validation.flip import Exposures, flip_map
from rsibr.validation.metrics import compare, energy_ratio_of, smape_of_texels, within
from rsibr.validation.reference import Reference

Array = NDArray[np.float64]
Image = NDArray[np.float32]


@dataclass(frozen=True)
class ZoneError:
    """Errors over the judged pixels of a zone.

    Attributes
    ----------
    share : float
        Share of the zone in the judged pixels.
    rel_mse : Estimate
        Mean of (a−b)²/(b²+ε), ε = (0.1·mean b)² over the whole picture, with the noise of the truth subtracted.
    smape, flip : Estimate
        Means of |a−b|/(|a|+|b|) and of HDR-FLIP. Neither is a smooth function of the noise of the truth: the jackknife
        removes a part of its contribution only, so that a perfect picture has values above 0.
    energy_ratio : Estimate or None
        Σa/Σb weighted by coverage, mean over channels; None if a channel is black in the truth only.
    """

    share: float
    rel_mse: Estimate
    smape: Estimate
    flip: Estimate
    energy_ratio: Estimate | None


@dataclass(frozen=True, eq=False)
class ObjectError:
    """Errors of a picture against one truth, over pixels with coverage ≥ ½.

    Attributes
    ----------
    whole : ZoneError
        Over all judged pixels.
    zones : dict of str to ZoneError
        Over those of each zone that has any.
    noise_floor : float
        RelMSE of a perfect picture due to the noise of the truth, if it were not subtracted.
    relative_error : ndarray, shape (H, W)
        Square root of the relative squared error, mean over channels, noise of the truth included; NaN where not
        judged.
    flip_map : ndarray, shape (H, W)
        HDR-FLIP; NaN where not judged.
    """

    whole: ZoneError
    zones: dict[str, ZoneError]
    noise_floor: float
    relative_error: Image
    flip_map: Image


def object_error(
    picture: Image, truth: Reference, zones: Mapping[str, NDArray[np.bool_]], exposures: Exposures, name: str
) -> ObjectError:
    """Compare the picture of an object with a truth.

    Parameters
    ----------
    picture : ndarray, shape (H, W, 3)
        Radiance, coverage divided out.
    truth : Reference
        Truth of the same rays.
    zones : mapping of str to ndarray of bool, shape (H, W)
        See `rsibr.validation.objects.zones`.
    exposures : Exposures
        Of FLIP.
    name : str
        Name of the picture in messages.

    Raises
    ------
    CheckFailed
        If picture or truth has NaN or Inf.
    """
    judged = truth.coverage >= COVERED
    found = compare(picture, truth, exposures, name, zones)
    inside = {"": np.ones(int(judged.sum()), dtype=np.bool_), **within(zones, judged)}
    inside = {zone: pixels for zone, pixels in inside.items() if pixels.any()}
    a, weights = picture[judged].astype(np.float64), truth.coverage[judged].astype(np.float64)
    k, mean = len(truth.buffers), truth.buffers.mean(axis=0, dtype=np.float64)

    def metrics(b: Array, flip: Image) -> Array:
        """SMAPE, FLIP and energy ratio of each zone, shape (zones, 3)."""
        smape, perceived = smape_of_texels(a, b[judged]).mean(axis=1), flip[judged]
        energy = [_or_nan(energy_ratio_of(a[i], b[judged][i], weights[i])) for i in inside.values()]
        zones = inside.values()
        return np.array([[smape[i].mean() for i in zones], [perceived[i].mean() for i in zones], energy]).T

    shown = _flip_against(picture, judged, exposures)
    whole = metrics(mean, found.flip_map)
    rest = [(k * mean - buffer) / (k - 1) for buffer in truth.buffers]
    left_out = np.array([metrics(b, shown(b)) for b in rest])
    rel_mse = {"": found.rel_mse, **found.rel_mse_zones}

    def error(number: int, zone: str) -> ZoneError:
        smape, flip, energy = (jackknife(whole[number, m], left_out[:, number, m]) for m in range(3))
        share = float(inside[zone].mean())
        return ZoneError(share, rel_mse[zone], smape, flip, energy if np.isfinite(energy.value) else None)

    errors = {zone: error(number, zone) for number, zone in enumerate(inside)}
    return ObjectError(errors.pop(""), errors, found.noise_floor, found.relative_error, found.flip_map)


def _flip_against(picture: Image, judged: NDArray[np.bool_], exposures: Exposures) -> Callable[[Array], Image]:
    """HDR-FLIP of the picture against a truth, black where not judged."""
    ours = np.where(judged[..., None], picture, 0)

    def flip(truth: Array) -> Image:
        return flip_map(np.where(judged[..., None], truth, 0), ours, exposures)

    return flip


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value

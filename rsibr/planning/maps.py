"""Model of a bake's maps: the albedo of each lobe times the environment filtered by that lobe."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from rsibr.light.harmonics import synthesis
from rsibr.light.probe import UNRESOLVED, LightProbe
from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.split import Lobe
from rsibr.planning.material_probe import LobeProbe
from rsibr.planning.model import attenuation

Image = NDArray[np.float64]

_ROWS, _COLUMNS = 128, 256
_SHARP = 0.5
"""Attenuation of the last band above which the unfiltered map is used: truncated harmonics would ring."""

_JUDGED = 64  # texels a side of the maps that are compared


def modelled_lobes(lobes: Sequence[Lobe], probes: Sequence[LobeProbe], light: LightProbe, size: int) -> list[Image]:
    """Modelled radiance of each lobe over a sphere map, relative to the mean of the environment.

    Parameters
    ----------
    lobes, probes : Lobe, LobeProbe
        The lobes of the material, in the same order.
    light : LightProbe
        Measurements of the environment.
    size : int
        Texels a side.

    Returns
    -------
    list of ndarray, each of shape (size, size, 3)
        Values at the texels' centres; NaN outside the disk.
    """
    centre = (np.arange(size) + 0.5) * 2 / size - 1
    x, y = np.meshgrid(centre, -centre)
    inside = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    images = []
    for lobe, probe in zip(lobes, probes, strict=True):
        direction = (x, y, z) if probe.kind == "diffuse" else (2 * x * z, 2 * y * z, 2 * z * z - 1)
        albedo = np.stack([np.interp(z, node_cosines(), lobe.albedo[:, c]) for c in range(3)], axis=-1)
        shown = np.maximum(_lookup(_sky(probe, light), *direction), 0)[..., None] * albedo
        images.append(np.where(inside[..., None], shown, np.nan))
    return images


def left_out_errors(lobes: Sequence[Lobe], probes: Sequence[LobeProbe], light: LightProbe) -> list[float]:
    """Modelled error of maps without each lobe: relMSE as of `rsibr validate`, at most 1.

    Parameters
    ----------
    lobes, probes : Lobe, LobeProbe
        The lobes of the material, in the same order.
    light : LightProbe
        Measurements of the environment.
    """
    if light.is_black:
        return [0.0] * len(probes)
    images = modelled_lobes(lobes, probes, light, _JUDGED)
    whole = np.sum(images, axis=0)
    return [min(1.0, relative_error(image, whole)) for image in images]


def relative_error(difference: Image, truth: Image) -> float:
    """relMSE: mean of d²/(b² + (0.1 mean b)²), with the mean of b per channel; NaN texels are ignored."""
    floor = (0.1 * np.nanmean(truth, axis=(0, 1))) ** 2 + 1e-30
    return float(np.nanmean(difference**2 / (truth**2 + floor)))


def _sky(probe: LobeProbe, light: LightProbe) -> Image:
    """Environment over its mean, filtered by the lobe, on a latitude–longitude grid."""
    factors = attenuation(probe)
    if light.variance == UNRESOLVED:  # no grid resolves it: only the albedo is modelled
        return np.ones((_ROWS, _COLUMNS))
    if probe.kind != "diffuse" and factors[-1] > _SHARP:
        return light.small
    return synthesis(light.spectrum * factors[:, None], _ROWS, _COLUMNS)


def _lookup(field: Image, x: Image, y: Image, z: Image) -> Image:
    rows, columns = field.shape
    row = np.arccos(np.clip(y, -1, 1)) / np.pi * (rows - 1)
    column = np.arctan2(x, -z) / (2 * np.pi) * columns - 0.5
    wrapped = np.pad(field, ((0, 0), (2, 2)), mode="wrap")
    return np.asarray(map_coordinates(wrapped, [row, np.mod(column, columns) + 2], order=1, mode="nearest"))

"""How few texels a map can have: a model of the map, held against itself at a lower resolution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from rsibr.effects.albedo import node_cosines
from rsibr.effects.harmonics import synthesis
from rsibr.effects.light_probe import UNRESOLVED, LightProbe
from rsibr.effects.lobes import Lobe
from rsibr.effects.material_probe import LobeProbe
from rsibr.effects.plan_model import attenuation

LEAST_RESOLUTION = 32
"""Texels a side below which no map is lowered."""

_MODELLED = 256
"""Texels a side of the model at most; a larger map is judged as if it had so many."""

_ROWS, _COLUMNS = 128, 256


def enlarged_error(
    lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, resolution: int, lower: int
) -> float:
    """Error (relMSE) of a map of `lower`² texels, enlarged to `resolution`², by the model; bands beyond count in full.

    Parameters
    ----------
    lobes, probes : Lobe, LobeProbe
        The lobes of the material, in the same order.
    light : LightProbe
        The environment, in harmonics.
    resolution, lower : int
        Texels a side; `lower` divides `resolution`.
    """
    fine = min(resolution, _MODELLED)
    factor = resolution // lower
    if light.is_black:
        return 0.0
    if light.variance == UNRESOLVED:
        return 1.0
    image = _model(lobes, probes, light, fine)
    inside = np.isfinite(image)
    small = _reduced(image, factor)
    large = _enlarged(small, fine)
    judged = inside & np.isfinite(large)
    mean = float(np.nanmean(image))
    error = (large - image)[judged] ** 2 / (image[judged] ** 2 + (0.1 * mean) ** 2)
    beyond = max(light.beyond * float(attenuation(lobe)[-1] ** 2) * lobe.share for lobe in probes)
    return float(error.mean()) + beyond * (1 + light.variance)


def sufficient_resolution(
    lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, resolution: int, threshold: float
) -> tuple[int, float]:
    """Lowest resolution, halved again and again from the one asked for, that errs by no more than the threshold.

    Returns
    -------
    resolution : int
        The one asked for where none below it suffices.
    error : float
        relMSE of the next lower one where it is the one asked for; otherwise its own.
    """
    lowest, error = resolution, 1.0
    candidate = resolution
    while candidate % 2 == 0 and candidate // 2 >= LEAST_RESOLUTION:
        candidate //= 2
        found = enlarged_error(lobes, probes, light, resolution, candidate)
        if found > threshold:
            return lowest, found if lowest == resolution else error
        lowest, error = candidate, found
    return lowest, error


def _model(lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, size: int) -> NDArray[np.float64]:
    """Grey radiance of a map, shape (size, size), NaN outside the disk: Σ E_k(θ) · (sky dampened as lobe k does)."""
    centre = (np.arange(size) + 0.5) * 2 / size - 1
    x, y = np.meshgrid(centre, -centre)
    square = x**2 + y**2
    z = np.sqrt(np.maximum(1 - square, 0))
    nodes = node_cosines()
    image = np.zeros((size, size))
    for lobe, probe in zip(lobes, probes, strict=True):
        field = synthesis(light.spectrum * attenuation(probe)[:, None], _ROWS, _COLUMNS)
        direction = (x, y, z) if probe.kind == "diffuse" else (2 * x * z, 2 * y * z, 2 * z * z - 1)
        image += np.interp(z, nodes, lobe.albedo.mean(axis=1)) * _lookup(field, *direction)
    return np.where(square < 1, image, np.nan)


def _lookup(
    field: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]
) -> NDArray[np.float64]:
    rows, columns = field.shape
    row = np.arccos(np.clip(y, -1, 1)) / np.pi * (rows - 1)
    column = np.arctan2(x, -z) / (2 * np.pi) * columns - 0.5
    wrapped = np.pad(field, ((0, 0), (2, 2)), mode="wrap")
    return np.asarray(map_coordinates(wrapped, [row, np.mod(column, columns) + 2], order=1, mode="nearest"))


def _reduced(image: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    size = len(image) // factor
    blocks = image[: size * factor, : size * factor].reshape(size, factor, size, factor)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    return np.where(count > 0, np.nansum(blocks, axis=(1, 3)) / np.maximum(count, 1), np.nan)


def _enlarged(small: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Bilinear interpolation, texels outside the disk taking no part."""
    at = (np.arange(size) + 0.5) * len(small) / size - 0.5
    grid = np.meshgrid(at, at, indexing="ij")
    weight = map_coordinates(np.isfinite(small).astype(float), grid, order=1, mode="nearest")
    value = map_coordinates(np.nan_to_num(small), grid, order=1, mode="nearest")
    return np.where(weight > 0, value / np.maximum(weight, 1e-9), np.nan)

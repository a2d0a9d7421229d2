"""Sufficient resolution of a map: a modelled map compared with itself at lower resolutions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from rsibr.light.probe import UNRESOLVED, LightProbe
from rsibr.lobes.split import Lobe
from rsibr.planning.maps import modelled_lobes, relative_error
from rsibr.planning.material_probe import LobeProbe
from rsibr.planning.model import attenuation

LEAST_RESOLUTION = 32
"""Lowest resolution that is chosen, texels a side."""

_MODELLED = 256
"""Highest resolution of the model, texels a side; larger maps are judged by it."""


def enlarged_error(
    lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, resolution: int, lower: int
) -> float:
    """Modelled error (relMSE) of a map of `lower`² texels, enlarged to `resolution`².

    The power beyond the last harmonic band counts as error in full.

    Parameters
    ----------
    lobes, probes : Lobe, LobeProbe
        The lobes of the material, in the same order.
    light : LightProbe
        Statistics of the environment.
    resolution, lower : int
        Texels a side; `lower` divides `resolution`.
    """
    fine = min(resolution, _MODELLED)
    factor = resolution // lower
    if light.is_black:
        return 0.0
    if light.variance == UNRESOLVED:
        return 1.0
    image = np.sum(modelled_lobes(lobes, probes, light, fine), axis=0)
    large = np.stack([_enlarged(_reduced(image[..., c], factor), fine) for c in range(3)], axis=-1)
    beyond = max(light.beyond * float(attenuation(lobe)[-1] ** 2) * lobe.share for lobe in probes)
    return relative_error(large - image, image) + beyond * (1 + light.variance)


def sufficient_resolution(
    lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, resolution: int, threshold: float
) -> tuple[int, float]:
    """Lowest resolution, by repeated halving, whose modelled error is at most the threshold.

    Returns
    -------
    resolution : int
        Texels a side; the given resolution if no lower one suffices.
    error : float
        relMSE of the result; of the next lower resolution if the result is the given one.
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


def _reduced(image: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    size = len(image) // factor
    blocks = image[: size * factor, : size * factor].reshape(size, factor, size, factor)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    return np.where(count > 0, np.nansum(blocks, axis=(1, 3)) / np.maximum(count, 1), np.nan)


def _enlarged(small: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Enlarge by bilinear interpolation, ignoring texels outside the disk."""
    at = (np.arange(size) + 0.5) * len(small) / size - 0.5
    grid = np.meshgrid(at, at, indexing="ij")
    weight = map_coordinates(np.isfinite(small).astype(float), grid, order=1, mode="nearest")
    value = map_coordinates(np.nan_to_num(small), grid, order=1, mode="nearest")
    return np.where(weight > 0, value / np.maximum(weight, 1e-9), np.nan)

"""Irradiance maps: the environment integrated over a cosine lobe, indexed by the surface normal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles

RESOLUTION = 64
"""Texels a side of an irradiance map, octahedral."""

_BLOCKS = 128  # blocks a side into which the environment is merged


def irradiance_map(picture: NDArray[np.float32], weights: NDArray[np.float64]) -> NDArray[np.float32]:
    """Mean radiance over a mixture of a bare and a coated cosine lobe.

    Parameters
    ----------
    picture : ndarray, shape (R, R, 3)
        Octahedral image of the radiance [W sr⁻¹ m⁻²].
    weights : ndarray, shape (2, 3)
        Weight of the bare and of the coated lobe in each channel; see `rsibr.lobes.gaussians.LobeShape.matte`.

    Returns
    -------
    ndarray, shape (RESOLUTION, RESOLUTION, 3), float32
        Radiance [W sr⁻¹ m⁻²], octahedral, indexed by the surface normal; equal to that of a constant environment.

    Notes
    -----
    The weight of a direction with cosine c is c (w_bare + w_coated (1 − (1 − c)⁵)), Schlick's transmission.
    """
    weights = np.where(weights.any(axis=0), weights, 1.0)  # in a black channel any shape serves
    radiance, angles, directions = _blocks(picture)
    level = np.empty((RESOLUTION**2, 3))
    normals = np.array(texel_directions(RESOLUTION), dtype=np.float64).T
    for rows in np.array_split(np.arange(len(level)), RESOLUTION // 4):  # in parts, to bound the memory
        cosines = np.maximum(normals[rows] @ directions.T, 0)
        coated = cosines * (1 - (1 - cosines) ** 5)
        gathered, total = ((cosines @ x) * weights[0] + (coated @ x) * weights[1] for x in (radiance, angles))
        level[rows] = gathered / total
    return level.astype(np.float32).reshape(RESOLUTION, RESOLUTION, 3)


def _blocks(light: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Merge texels into blocks: radiance times solid angle, solid angle, and mean direction, each (blocks, 3)."""
    side = max(1, len(light) // _BLOCKS)
    count = len(light) // side
    angles = texel_solid_angles(len(light))[:, None]
    directions = np.array(texel_directions(len(light)), dtype=np.float64).T

    def merged(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(values.reshape(count, side, count, side, 3).sum(axis=(1, 3)).reshape(-1, 3))

    radiance = light.reshape(-1, 3) * angles
    brightness = radiance.sum(axis=1, keepdims=True)
    centres = merged(directions * (brightness + 1e-9 * angles * brightness.max(initial=1e-30)))
    unit = centres / np.linalg.norm(centres, axis=1, keepdims=True)
    return merged(radiance), merged(np.repeat(angles, 3, axis=1)), unit

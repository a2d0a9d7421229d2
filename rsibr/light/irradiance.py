"""Irradiance maps: the environment integrated over a cosine lobe, indexed by the surface normal."""

from __future__ import annotations

import hashlib

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.geometry.to_device import to_device

RESOLUTION = 64
"""Texels a side of an irradiance map, octahedral."""

_BLOCKS = 128  # blocks a side into which the environment is merged
_COLUMNS = 7  # of the table of blocks: direction, radiance, solid angle

BARE = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
"""Weights of the bare cosine lobe alone."""

COATED = BARE[::-1]
"""Weights of the coated cosine lobe alone."""

_WEIGHT_OF = np.array([1.0, 20 / 21])[:, None]
"""Integral of the bare and of the coated lobe over the hemisphere, in units of π."""

_REMEMBERED = 64  # environments whose sums are kept: 0.3 MB each

_remembered: dict[tuple[bytes, bool], tuple[NDArray[np.float64], NDArray[np.float64]]] = {}


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
    gathered, total = _sums(picture, is_coated=bool(weights[1].any()))
    mean = np.einsum("lc,lnc->nc", weights, gathered) / np.einsum("lc,ln->nc", weights, total)
    return np.asarray(mean.reshape(RESOLUTION, RESOLUTION, 3), dtype=np.float32)


def mixed(bare: NDArray[np.float32], coated: NDArray[np.float32], weights: NDArray[np.float64]) -> NDArray[np.float32]:
    """Irradiance map of a mixture from those of its two lobes alone, with weights `BARE` and `COATED`."""
    weights = np.where(weights.any(axis=0), weights, 1.0) * _WEIGHT_OF
    share = weights / weights.sum(axis=0)
    return np.asarray(share[0] * bare + share[1] * coated, dtype=np.float32)


def _sums(picture: NDArray[np.float32], is_coated: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sums of `_gathered`, which serve all weights: kept, for materials under one sky follow each other."""
    digest = hashlib.sha256(picture.tobytes()).digest()
    key = digest, is_coated or (digest, True) in _remembered  # with those of the coated lobe come those of the bare one
    if key not in _remembered:
        _remembered[key] = _gathered(*_blocks(picture), is_coated=is_coated)
    while len(_remembered) > _REMEMBERED:
        _remembered.pop(next(iter(_remembered)))
    return _remembered[key]


def _gathered(
    radiance: NDArray[np.float64], angles: NDArray[np.float64], directions: NDArray[np.float64], is_coated: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum over the blocks, weighted by the bare and the coated lobe: radiance, shape (2, N, 3), and angle, (2, N).

    In double precision, so that sixteen thousand terms round to the same float32 in any order.
    """
    rows = np.concatenate([directions, radiance, angles[:, :1]], axis=1)
    table, count = to_device(mi.Float64, rows), dr.opaque(mi.UInt32, len(rows))
    normals = mi.Vector3d(texel_directions(RESOLUTION))

    def add(i: mi.UInt32, bare: mi.Vector4d, coated: mi.Vector4d) -> tuple[mi.UInt32, mi.Vector4d, mi.Vector4d]:
        x, y, z, *light = (dr.gather(mi.Float64, table, _COLUMNS * i + column) for column in range(_COLUMNS))
        cosine = dr.maximum(dr.dot(normals, mi.Vector3d(x, y, z)), 0)
        block = mi.Vector4d(*light)
        if is_coated:
            beside = 1 - cosine
            coated += block * (cosine * (1 - dr.square(dr.square(beside)) * beside))
        return i + 1, bare + block * cosine, coated

    lanes = RESOLUTION**2
    _, *sums = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Vector4d, lanes), dr.zeros(mi.Vector4d, lanes)),
        cond=lambda i, _bare, _coated: i < count,
        body=add,
        labels=("i", "bare", "coated"),
        label="irradiance",
    )
    both = np.stack([np.array(one, dtype=np.float64).T for one in sums])
    return both[..., :3], both[..., 3]


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

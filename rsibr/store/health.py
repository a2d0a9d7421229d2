"""Numerical health of one map: texels that are no number, that are missing, or that their variance says not to trust.

Nothing is repaired here: a finding is counted, its place kept, and the map stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.store.manifest import HealthRecord
from rsibr.store.map_file import MapFile

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]

LARGEST_HALF = 65504.0
"""Largest finite number of IEEE 754 binary16: a viewer or a texture in half precision makes Inf of more."""

FEW_SAMPLES = 0.25
"""Relative standard error from which on a texel rests on fewer than 1/0.25² = 16 of its samples."""

OUTLIER = 8.0
"""Standard errors, the neighbourhood's median one, by which a firefly outshines the neighbourhood's median."""

NOISIER = 6.0
"""Ratio of a firefly's standard error to the neighbourhood's median one."""

REACH = 2
"""Texels in each direction that are the neighbourhood: 5 × 5, of which the median stands up to twelve fireflies."""

_AT_ONCE = 2**16
"""Texels whose neighbourhoods are gathered together: bounds the memory at 30 MiB."""


@dataclass(frozen=True, eq=False)
class MapHealth:
    """What is wrong with one map, texel by texel.

    Attributes
    ----------
    found : dict of str to ndarray of bool, shape (N, N)
        Texels of each kind:

        - `non_finite`: a lobe's radiance or the variance is NaN or Inf;
        - `holes`: less than half of the texel's share of the disk is covered;
        - `fireflies`: see `firefly_texels`;
        - `half_overflow`: a lobe's radiance exceeds `LARGEST_HALF`.

        Texels outside the disk are never found: nothing reads them.
    relative_error : ndarray, shape (N, N)
        Standard error of each texel over its radiance, mean of the channels; NaN outside the disk and where there is no
        finite one.
    largest : float
        Largest finite radiance of any lobe and channel [W sr⁻¹ m⁻²]; 0 where there is none.
    """

    found: dict[str, Mask]
    relative_error: Array
    largest: float

    def record(self) -> HealthRecord:
        """Return the counts, as the manifest keeps them."""
        counts = {kind: int(mask.sum()) for kind, mask in self.found.items()}
        return HealthRecord(largest=self.largest, **counts)


def map_health(map_file: MapFile) -> MapHealth:
    """Look for texels of a map that cannot be trusted.

    Parameters
    ----------
    map_file : MapFile
        Without a variance nothing can be called a firefly.

    Returns
    -------
    MapHealth
    """
    layers = np.stack(list(map_file.layers.values()))
    exact = _coverage(map_file.resolution)
    inside = exact > 0
    hole = inside & ~(map_file.coverage >= 0.5 * exact)  # a NaN is a hole too
    covered = inside & (map_file.coverage > 0)
    finite = np.isfinite(layers)
    sound = covered & finite.all(axis=(0, 3))
    if map_file.variance is not None:
        sound &= np.isfinite(map_file.variance).all(axis=-1)
    radiance = np.full(sound.shape, np.nan)
    radiance[sound] = layers[:, sound].sum(axis=0, dtype=np.float64).mean(axis=-1)
    error = _standard_error(map_file.variance, sound)
    found = {
        "non_finite": covered & ~sound,
        "holes": hole,
        "fireflies": firefly_texels(radiance, error),
        "half_overflow": covered & (finite & (layers > LARGEST_HALF)).any(axis=(0, 3)),
    }
    largest = np.max(layers, initial=0.0, where=finite & covered[..., None])
    return MapHealth(found, _ratio(error, radiance), float(largest))


def firefly_texels(radiance: Array, error: Array) -> Mask:
    """Texels of which a few samples make the value, and whose neighbours saw none of the like.

    Parameters
    ----------
    radiance, error : ndarray, shape (H, W)
        Radiance and its standard error, mean of the channels; NaN where there is none to judge.

    Returns
    -------
    ndarray of bool, shape (H, W)
        With L and e of the texel, and the medians L̃ and ẽ of its 5 × 5 neighbourhood: e > `FEW_SAMPLES`·L,
        e > `NOISIER`·ẽ and L > L̃ + `OUTLIER`·ẽ, all three. Noise that is as strong all around is no firefly.

    Notes
    -----
    False alarms, for Gaussian noise on a flat neighbourhood, measured on 8e5 texels of 30 % noise: 3e-6 a texel of two
    blocks (a bake of 4 to 11 samples), where mean and error have one degree of freedom between them; on 6e6 texels none
    at all, so below 5e-7 with 95 % confidence, of 3 and 4 blocks. With 8 a chi-square variable of 7 degrees of freedom
    would have to exceed 36 times its median: below 1e-45.
    """
    suspect = np.argwhere(error > FEW_SAMPLES * np.abs(radiance))
    found = np.zeros(radiance.shape, dtype=np.bool_)
    for places in _chunks(suspect):
        row, column = places.T
        local, local_error = (_median_around(values, places) for values in (radiance, error))
        own, own_error = radiance[row, column], error[row, column]
        found[row, column] = (own_error > NOISIER * local_error) & (own > local + OUTLIER * local_error)
    return found


def _median_around(values: Array, places: NDArray[np.intp]) -> Array:
    """Median of the neighbourhoods of places (K, 2), the places themselves included, NaN left out."""
    padded = np.pad(values, REACH, constant_values=np.nan)
    steps = np.arange(2 * REACH + 1)
    row, column = (places[:, axis, None, None] for axis in (0, 1))
    around = padded[row + steps[:, None], column + steps]
    return np.asarray(np.nanmedian(around.reshape(len(places), -1), axis=1))


def _chunks(places: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    for start in range(0, len(places), _AT_ONCE):
        yield places[start : start + _AT_ONCE]


def _standard_error(variance: NDArray[np.float32] | None, sound: Mask) -> Array:
    """Standard error of the channels' mean, at most: the channels share their samples and err together."""
    if variance is None:
        return np.full(sound.shape, np.nan)
    deviation = np.sqrt(np.where(sound[..., None], variance, 0.0).astype(np.float64))
    return np.where(sound, deviation.mean(axis=-1), np.nan)


def _ratio(error: Array, radiance: Array) -> Array:
    """Error over radiance; 0 where both are, Inf where light is all noise."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(error == 0, 0.0, error / np.abs(radiance))


_coverage = lru_cache(maxsize=1)(stored_coverage)

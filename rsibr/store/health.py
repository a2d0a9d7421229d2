"""Numerical health of a map: non-finite, missing and unreliable texels.

Findings are counted and located; the map is not modified.
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
"""Largest finite IEEE 754 binary16; larger values become Inf in half-precision viewers and textures."""

FEW_SAMPLES = 0.25
"""Relative standard error above which fewer than 1/0.25² = 16 samples dominate a texel."""

OUTLIER = 8.0
"""Least excess of a firefly over the neighbourhood's median radiance, in median standard errors."""

NOISIER = 6.0
"""Least ratio of a firefly's standard error to the neighbourhood's median standard error."""

REACH = 2
"""Radius of the neighbourhood in texels: 5 × 5, whose median is robust against twelve fireflies."""

_AT_ONCE = 2**16
"""Texels whose neighbourhoods are processed together; bounds the memory at 30 MiB."""


@dataclass(frozen=True, eq=False)
class MapHealth:
    """Findings in one map, texel by texel.

    Attributes
    ----------
    found : dict of str to ndarray of bool, shape (N, N)
        Texels of each kind:

        - `non_finite`: a lobe's radiance or the variance is NaN or Inf;
        - `holes`: less than half of the texel's share of the disk is covered;
        - `fireflies`: see `firefly_texels`;
        - `half_overflow`: a lobe's radiance exceeds `LARGEST_HALF`.

        Texels outside the disk, which are never read, are not reported.
    relative_error : ndarray, shape (N, N)
        Standard error of each texel relative to its radiance, mean of the channels; NaN outside the disk and where
        either is not finite.
    largest : float
        Largest finite radiance of any lobe and channel [W sr⁻¹ m⁻²]; 0 if there is none.
    """

    found: dict[str, Mask]
    relative_error: Array
    largest: float

    def record(self) -> HealthRecord:
        """Return the counts, as recorded in the manifest."""
        counts = {kind: int(mask.sum()) for kind, mask in self.found.items()}
        return HealthRecord(largest=self.largest, **counts)


def map_health(map_file: MapFile, *, captured: bool = False) -> MapHealth:
    """Find the unreliable texels of a map.

    Parameters
    ----------
    map_file : MapFile
        The map; fireflies are found only if it has a variance.
    captured : bool
        Whether texels may be missing because no photograph shows them; then they are no holes.

    Returns
    -------
    MapHealth
    """
    # Covered texels with finite radiance and variance
    layers = np.stack(list(map_file.layers.values()))
    exact = _coverage(map_file.resolution)
    inside = exact > 0
    least = 0.0 if captured else 0.5
    hole = inside & ~(map_file.coverage >= least * exact)  # a NaN is a hole too
    covered = inside & (map_file.coverage > 0)
    finite = np.isfinite(layers)
    sound = covered & finite.all(axis=(0, 3))
    if map_file.variance is not None:
        sound &= np.isfinite(map_file.variance).all(axis=-1)
    # Radiance and standard error, mean of the channels, and the findings
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
    """Fireflies: texels dominated by a few samples, unlike their neighbours.

    Parameters
    ----------
    radiance, error : ndarray, shape (H, W)
        Radiance [W sr⁻¹ m⁻²] and its standard error, mean of the channels; NaN in texels to ignore.

    Returns
    -------
    ndarray of bool, shape (H, W)
        True where e > `FEW_SAMPLES`·L, e > `NOISIER`·ẽ and L > L̃ + `OUTLIER`·ẽ, with L and e of the texel and the
        medians L̃ and ẽ of its 5 × 5 neighbourhood. Uniformly strong noise is not a firefly.

    Notes
    -----
    False-positive rate a texel, for Gaussian noise of 30 % on a constant neighbourhood: with two blocks (4 to 11
    samples), where the error has one degree of freedom, 3e-6, measured on 8e5 texels; with 3 and 4 blocks below 5e-7 at
    95 % confidence, none in 6e6 texels; with 8 blocks a chi-square variable of 7 degrees of freedom would have to
    exceed 36 times its median: below 1e-45.
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
    """Median of the neighbourhoods of texels (K, 2), the texels included, ignoring NaN."""
    padded = np.pad(values, REACH, constant_values=np.nan)
    steps = np.arange(2 * REACH + 1)
    row, column = (places[:, axis, None, None] for axis in (0, 1))
    around = padded[row + steps[:, None], column + steps]
    return np.asarray(np.nanmedian(around.reshape(len(places), -1), axis=1))


def _chunks(places: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    for start in range(0, len(places), _AT_ONCE):
        yield places[start : start + _AT_ONCE]


def _standard_error(variance: NDArray[np.float32] | None, sound: Mask) -> Array:
    """Upper bound of the standard error of the channels' mean: channels share samples, so errors are correlated."""
    if variance is None:
        return np.full(sound.shape, np.nan)
    deviation = np.sqrt(np.where(sound[..., None], variance, 0.0).astype(np.float64))
    return np.where(sound, deviation.mean(axis=-1), np.nan)


def _ratio(error: Array, radiance: Array) -> Array:
    """Error over radiance; 0 where the error is 0, Inf where only the radiance is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(error == 0, 0.0, error / np.abs(radiance))


_coverage = lru_cache(maxsize=1)(stored_coverage)

"""What several balls show, put together, and whether they agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CONTRADICTION = 0.5
"""Share of a lower bound below which what another ball shows contradicts it."""

_LEAST_SHARED = 90  # channels of texels that two balls must share to be compared
_MOST_RATIO = 1.15
_MOST_SPREAD = 0.15


@dataclass(frozen=True, eq=False)
class Shown:
    """What one ball shows of the environment.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, 3)
        Mean over each texel.
    weight : ndarray, shape (H, W)
        Of the texel in a mean over several balls; 0: not seen.
    saturated : ndarray, shape (H, W), bool
        Whether part of the texel is a lower bound.
    """

    radiance: Array
    weight: Array
    saturated: NDArray[np.bool_]


def combined(shown: Sequence[Shown]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Weighted mean radiance of several balls, its weight, and where it is a lower bound.

    Where one ball is saturated and another is not, the other alone counts: a bound is never averaged in. Unless the
    other shows less than half of the bound: then it saw something else, and the largest bound stays.
    """
    radiance = np.stack([one.radiance for one in shown])
    weight = np.stack([one.weight for one in shown])
    saturated = np.stack([one.saturated for one in shown])
    known = _mean(radiance, np.where(saturated, 0.0, weight))
    bound = np.where(saturated[..., None], radiance, 0.0).max(axis=0)
    is_bound = saturated.any(axis=0) & (known.mean(axis=2) < _CONTRADICTION * bound.mean(axis=2))
    return np.where(is_bound[..., None], bound, known), weight.sum(axis=0), is_bound


def _mean(radiance: Array, weight: Array) -> Array:
    total = weight.sum(axis=0)
    return np.asarray((radiance * weight[..., None]).sum(axis=0) / np.where(total > 0, total, 1.0)[..., None])


def disagreements(names: Sequence[str], shown: Sequence[Shown]) -> Iterator[str]:
    """Yield a note for each two balls that do not show the same where both see.

    By the median ratio of what they share, which tells another exposure, and by the spread about it, which tells
    another direction of the camera, or another scene.
    """
    for (first, one), (second, other) in combinations(zip(names, shown, strict=True), 2):
        shared = (one.weight > 0) & (other.weight > 0) & ~one.saturated & ~other.saturated
        a, b = one.radiance[shared].ravel(), other.radiance[shared].ravel()
        lit = (a > 0) & (b > 0)
        if lit.sum() < _LEAST_SHARED:
            continue
        ratios = np.log(b[lit] / a[lit])
        middle = float(np.median(ratios))
        spread = float(np.median(np.abs(ratios - middle)))
        if spread > _MOST_SPREAD:
            yield f"{first} and {second} show different surroundings: check each --view, --up, and outline"
        elif abs(middle) > np.log(_MOST_RATIO):
            yield (
                f"{second} shows what it shares with {first} {np.exp(middle):.2f} times as bright: check their "
                "exposures, or merge both with the same curve"
            )

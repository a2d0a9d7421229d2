"""Verdict on a finished bake as a whole: whether its maps are good for anything.

Single bad texels are counted and located (`rsibr.store.health`). A bake whose maps are largely not a number, or black
although there is light and the material reflects, is no result at all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.store.manifest import Manifest

MOST_NON_FINITE = 0.01
"""Share of the texels of all maps up to which values that are not finite count as single bad texels."""


def non_finite_share(manifest: Manifest) -> float:
    """Share of the covered texels of all finished maps in which a value is not finite; 0 if that was not recorded."""
    counts = [state.health.non_finite for state in manifest.views if state.health is not None]
    covered = int(np.count_nonzero(stored_coverage(manifest.resolution)))
    return sum(counts) / (len(counts) * covered) if counts else 0.0


def is_all_black(manifest: Manifest) -> bool:
    """Whether no finished map has a value above 0; False if that was not recorded."""
    largest = [state.health.largest for state in manifest.views if state.health is not None]
    return bool(largest) and max(largest) <= 0.0


def fault_of(manifest: Manifest, should_shine: Callable[[], bool]) -> str:
    """Reason why the maps of a bake as a whole are unusable; empty if they are not.

    Parameters
    ----------
    manifest : Manifest
        Manifest of a finished bake.
    should_shine : callable
        Whether there is light and the material reflects; called only if all maps are black.

    Examples
    --------
    >>> fault_of(bake.manifest, lambda: True)                                              # doctest: +SKIP
    'all maps are black, although there is light and the material reflects'
    """
    share = non_finite_share(manifest)
    if share > MOST_NON_FINITE:
        return f"{100 * share:.3g} % of the texels are not finite (NaN or infinite)"
    if is_all_black(manifest) and should_shine():
        return "all maps are black, although there is light and the material reflects"
    return ""

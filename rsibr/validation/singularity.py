"""How much of a new view is looked up near the singularity of a stored one."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centres
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.methods.warp_blend.source_maps import StoredView
from rsibr.methods.warp_blend.warp import MirrorWarp

NEAR = 0.1
"""Confidence of a source below which its lookup counts as near the singularity."""

_RESOLUTION = 64
"""Texels a side: the area of a circle of radius `NEAR` is then known to a few per cent."""


def near_singularity(viewpoints: Viewpoints, views: Sequence[NDArray[np.float64]]) -> float:
    """Share of texels that a source with a confidence below `NEAR` takes part in, averaged over new views.

    Parameters
    ----------
    viewpoints : Viewpoints
        The stored views; the three around a new one are its sources.
    views : sequence of ndarray, shape (3,)
        New unit view directions, at least one.

    Returns
    -------
    float
        In [0, 1]. A source's singularity is a point of the map, so up to 3 · `NEAR`² = 0.03 is what the method has of
        itself; a source that is the new view alone has none that matters and counts as if it did.
    """
    p = texel_centres(_RESOLUTION)
    inside = np.array(dr.squared_norm(p)) <= 1
    n = normal_from_disk(p)
    return float(np.mean([_touched(viewpoints, view, n)[inside].mean() for view in views]))


def _touched(viewpoints: Viewpoints, view: NDArray[np.float64], n: mi.Vector3f) -> NDArray[np.bool_]:
    """Lanes of which a source of `view` is not to be trusted."""
    frame = mi.Matrix3f(view_frame(view).astype(np.float32))
    sources = viewpoints.surrounding(mi.Vector3f(*view.tolist()))
    touched = np.zeros(dr.width(n), dtype=np.bool_)
    for corner in range(3):
        index = int(np.array(sources[corner])[0])
        axes = (mi.Vector3f(*axis) for axis in view_frame(viewpoints.directions[index]).T.tolist())
        stored = StoredView(mi.UInt32(index), *axes)
        _, confidence = MirrorWarp.between(stored, frame)(n)
        touched |= np.array(confidence) < NEAR
    return touched

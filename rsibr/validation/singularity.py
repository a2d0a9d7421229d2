"""Share of a novel view that is looked up near the singularity of a stored view."""

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
"""Confidence of a source below which a lookup counts as near the singularity."""

_RESOLUTION = 64
"""Texels a side; resolves the area of a circle of radius `NEAR` to a few per cent."""


def near_singularity(viewpoints: Viewpoints, views: Sequence[NDArray[np.float64]]) -> float:
    """Share of texels with a source of confidence below `NEAR`, averaged over novel views.

    Parameters
    ----------
    viewpoints : Viewpoints
        Stored views; the three around a novel view are its sources.
    views : sequence of ndarray, shape (3,)
        Novel unit view directions, at least one.

    Returns
    -------
    float
        In [0, 1]. The singularity of a source is a point of the map, so the method itself causes up to
        3 · `NEAR`² = 0.03. At a stored view the singularity has no effect, but is counted all the same.
    """
    p = texel_centres(_RESOLUTION)
    inside = np.array(dr.squared_norm(p)) <= 1
    n = normal_from_disk(p)
    return float(np.mean([_touched(viewpoints, view, n)[inside].mean() for view in views]))


def _touched(viewpoints: Viewpoints, view: NDArray[np.float64], n: mi.Vector3f) -> NDArray[np.bool_]:
    """Whether any source of `view` has a confidence below `NEAR`, for each lane of `n`."""
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

"""Whether the faces of a cube fit at their edges: a face that is turned, mirrored or swapped does not.

Texels on both sides of an edge of the cube are neighbours, and differ as neighbours inside a face do. Medians along an
edge judge it, of differences of logarithms: a sun on the edge is a few texels, and its brightness counts as any other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.faces import FACES
from rsibr.geometry.projections.projection import Projection

Sheets = NDArray[np.floating]

LEAST_SIDE = 8
"""Texels a side below which edges are not judged: too few for a median."""

UNLIKE = 4.0
"""Step across an edge over the step between neighbours inside a face, from which on they do not fit.

The fourth largest of the 24 sides of a right cube (`scenes/environments`, 16² to 256²) has 1.8 at most; of a cube with
a face turned by 90° it has 4.7 at least from 64² on.
"""

_SIDES = 4  # of 24: two edges, each seen from both faces
_LEAST_STEP = 0.02  # of a logarithm: steps between neighbours in an even sky count as so many
_DARKEST = 0.01  # of the median radiance


def unfit_faces(sheets: Sheets, of: Projection) -> str:
    """Sentence on faces that do not fit at their edges; empty if all fit.

    Parameters
    ----------
    sheets : ndarray, shape (6, N, N, 3)
        Radiance of the faces, not negative.
    of : Projection
        Their projection.
    """
    if sheets.shape[1] < LEAST_SIDE or not sheets.any():
        return ""
    is_unlike = steps_across(sheets, of) > UNLIKE
    if is_unlike.sum() < _SIDES:
        return ""
    counts = is_unlike.sum(axis=1)
    worst = int(counts.argmax())
    advice = "check that none is turned, mirrored or named wrongly"
    if (counts == counts[worst]).sum() == 1:
        return f"its face {FACES[worst]} does not fit its neighbours at {counts[worst]} of 4 edges: {advice}"
    return f"its faces do not fit each other at their edges ({', '.join(np.array(FACES)[counts > 0])}): {advice}"


def steps_across(sheets: Sheets, of: Projection) -> NDArray[np.float64]:
    """Median step across each side of each face, over that between neighbours inside, shape (6, 4)."""
    grey = np.asarray(sheets, dtype=np.float64).mean(axis=-1, keepdims=True)
    logarithm = np.log(grey + _DARKEST * np.median(grey[grey > 0]))
    framed = np.asarray(of.bordered(logarithm.astype(np.float32)), dtype=np.float64)[..., 0]
    turned = np.stack([np.rot90(framed, turns, axes=(1, 2)) for turns in range(4)], axis=1)
    across = np.median(np.abs(turned[:, :, 0, 1:-1] - turned[:, :, 1, 1:-1]), axis=-1)
    inside = np.median(np.abs(turned[:, :, 1, 1:-1] - turned[:, :, 2, 1:-1]), axis=-1)
    return np.asarray(across / np.maximum(np.maximum(inside, np.median(inside)), _LEAST_STEP))

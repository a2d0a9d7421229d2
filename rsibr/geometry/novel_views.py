"""Novel views for validation: half at the points farthest from stored views, half random."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.frame import unit_view
from rsibr.geometry.viewpoints import Viewpoints

CENTROID, RANDOM = "triangle centroid", "random"


def novel_views(
    viewpoints: Viewpoints, count: int, seeds: np.random.SeedSequence
) -> list[tuple[str, NDArray[np.float64]]]:
    """Draw view directions, the same for the same stored views, count and seeds.

    Parameters
    ----------
    viewpoints : Viewpoints
        Stored views; the centroids of their triangles are the points farthest from any of them.
    count : int
        Number of views, at least 1: the first half, rounded up, at centroids, as far as there are triangles.
    seeds : SeedSequence
        Separate branch of the seed tree.

    Returns
    -------
    list of (str, ndarray of shape (3,))
        Origin of each view, `CENTROID` or `RANDOM`, and its unit direction.
    """
    generator = np.random.default_rng(seeds)
    worst = min((count + 1) // 2, len(viewpoints.triangles))
    chosen = viewpoints.triangles[generator.permutation(len(viewpoints.triangles))[:worst]]
    centroids = viewpoints.directions[chosen].sum(axis=1)
    random = generator.normal(size=(count - worst, 3))
    labels = [CENTROID] * worst + [RANDOM] * len(random)
    return [(label, unit_view(view)) for label, view in zip(labels, [*centroids, *random], strict=True)]

"""In which triangle of the viewpoints a direction lies: our grid against SciPy's tree of points, in one run."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial import cKDTree

from rsibr.geometry.viewpoints import icosphere
from tests.arrays import unit_vectors, vector
from tests.benchmarks.turns import in_turns, report

DIRECTIONS = 2**18


@pytest.mark.benchmark(group="point location")
@pytest.mark.parametrize("subdivision", [0, 2, 5])
def test_point_location(benchmark, rng, subdivision):
    """Ours is asked for the three corners of the triangle that a direction lies in, on the device.

    The peer finds less, the nearest viewpoint alone, on as many threads; the limit is a copy of what goes in and out.
    """
    views = icosphere(subdivision)
    sphere, rows = views.on_device, unit_vectors(rng, DIRECTIONS)
    directions, points = vector(rows), cKDTree(views.directions)
    source = np.zeros(DIRECTIONS * (3 + 3), np.float32)
    target = np.empty_like(source)

    def ours(_):
        dr.eval(sphere.surrounding(directions))
        dr.sync_thread()

    seconds = in_turns({
        "ours": ours,
        "SciPy, nearest viewpoint": lambda _: points.query(rows, workers=dr.thread_count()),
        "copy": lambda _: np.copyto(target, source),
    })  # fmt: skip
    benchmark.pedantic(lambda: ours(0), rounds=5)
    report(benchmark, f"{DIRECTIONS} directions among {len(views)} viewpoints", seconds)
    _check_that_the_corners_surround(sphere, rows, views)


def _check_that_the_corners_surround(sphere, rows, views):
    """Each direction lies on the inner side of its triangle's three sides: computed without the grid."""
    corners = views.directions[np.array(sphere.surrounding(mi.Vector3f(vector(rows)))).T]
    sides = np.einsum("nki,ni->nk", np.cross(corners, np.roll(corners, -1, axis=1)), rows)
    orientation = np.sign(np.linalg.det(corners))[:, None]
    assert (sides * orientation).min() > -1e-5

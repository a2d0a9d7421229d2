"""New views: half in the middle of triangles, half random, the same for the same seeds."""

import numpy as np
import pytest

from rsibr.geometry.novel_views import CENTROID, RANDOM, novel_views
from rsibr.geometry.viewpoints import icosphere, witness


def drawn(viewpoints, count, seed=3):
    return novel_views(viewpoints, count, np.random.SeedSequence(seed))


@pytest.mark.parametrize(("count", "worst"), [(1, 1), (8, 4), (9, 5), (100, 20)])
def test_the_first_half_is_as_far_from_all_stored_views_as_can_be(count, worst):
    """The icosahedron's twenty faces are alike: no direction is farther from its corners than their centroids."""
    stored = icosphere(0)
    views = drawn(stored, count)
    assert [label for label, _ in views] == [CENTROID] * worst + [RANDOM] * (count - worst)
    nearest = [(stored.directions @ view).max() for _, view in views]
    assert np.allclose(nearest[:worst], 0.7946544722917661)
    assert min(nearest) >= 0.7946544
    assert np.allclose([np.linalg.norm(view) for _, view in views], 1)
    assert len({tuple(view.round(6)) for _, view in views}) == count


def test_equal_seeds_give_equal_views_and_others_others():
    one, again, other = (drawn(icosphere(1), 6, seed) for seed in (3, 3, 4))
    assert all(np.array_equal(a[1], b[1]) for a, b in zip(one, again, strict=True))
    assert not any(np.array_equal(a[1], b[1]) for a, b in zip(one, other, strict=True))


def test_without_triangles_all_are_random():
    assert [label for label, _ in drawn(witness(icosphere(0)), 4)] == [RANDOM] * 4

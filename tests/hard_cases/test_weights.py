"""Hard cases 1 to 8: weights, and the location of a point on the sphere of views."""

import functools

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import from_directions, icosphere
from rsibr.methods.warp_blend.warp import NormalWarp, NoWarp
from tests.arrays import unit_vectors
from tests.hard_cases.exact import (
    WEIGHTS,
    as_float32,
    edge_points,
    exact_weights,
    normalised,
    query,
    side_distances,
)
from tests.methods.scene import image, inside, method
from tests.methods.warp_blend.test_method import METHODS

LEVELS = range(6)
ULP = 2**-24
"""What rounding a component of a unit vector to float32 may move it by."""

every_level = pytest.mark.parametrize("level", LEVELS)
each_kind = pytest.mark.parametrize("kind", WEIGHTS)
sphere = functools.cache(icosphere)


def smallest_height(views):
    """Least distance of a corner from the opposite side: how fast a weight can change."""
    corners = views.directions[views.triangles]
    return min(side_distances(corners[:, k], corners)[:, k].min() for k in range(3))


@each_kind
@every_level
def test_hc01_a_view_at_a_vertex_has_one_hot_weights(level, kind):
    """Exactly 1 for the view itself and exactly 0 for the others, whichever of the vertex's triangles is found.

    Fails when the weights multiply by the reciprocal of their sum in place of dividing, or take determinants that are
    not of differences: mutants hc01.
    """
    views = sphere(level)
    found = query(views, views.directions, kind)
    at_the_view = found.per_view == np.arange(len(views))
    assert (at_the_view.sum(axis=0) == 1).all()
    assert np.array_equal(found.weights, at_the_view.astype(float))


@each_kind
@every_level
def test_hc02_a_view_on_an_edge_gives_the_opposite_view_nothing(level, kind, rng):
    """Opposite weight at most 2e-7, beyond what the rounding of the query itself moves it off the edge.

    That rounding is half an ulp of each component: 3e-8 of a side's height at level 0, 2.5e-6 at level 5.
    Fails when solid angles or volumes are not taken of differences: mutants hc02.
    """
    views = sphere(level)
    v, ends = edge_points(views, rng)
    found = query(views, v, kind)
    off_edge = ~((found.per_view == ends[:, 0]) | (found.per_view == ends[:, 1]))
    assert (off_edge.sum(axis=0) == 1).all()  # the triangle found is one of the edge's two
    assert np.isfinite(found.weights).all()
    rounded_by = np.sqrt(3) * 2 * ULP / smallest_height(views)
    assert found.weights[off_edge].max() <= 2e-7 + rounded_by
    if level < 2:
        assert found.weights[off_edge].max() <= 2e-7


@pytest.mark.parametrize(("kind", "jump"), [("gnomonic", 2e-6), ("area", 1.4e-3)])
@every_level
def test_hc03_weights_change_little_from_one_side_of_an_edge_to_the_other(level, kind, jump, rng):
    """1e-7 to either side: at most 2e-6 for gnomonic weights, at most 1.4e-3 for area weights.

    On top of it the weights' own slope, 1/height, times the way between the two float32 queries.
    Fails when `gnomonic_weights` are areas: mutant hc03.
    """
    views = sphere(level)
    v, ends = edge_points(views, rng)
    across = normalised(np.cross(views.directions[ends[:, 0]], views.directions[ends[:, 1]]))
    sides = [query(views, normalised(v + side * 1e-7 * across), kind) for side in (1, -1)]
    dense = np.zeros((2, len(v), len(views))) if level < 4 else None
    way = np.linalg.norm(sides[0].v - sides[1].v, axis=1).max() / smallest_height(views)
    if dense is not None:
        for one, found in zip(dense, sides, strict=True):
            one[np.arange(len(v)), found.per_view] = found.weights
        assert np.abs(dense[0] - dense[1]).max() <= jump + way
    for end in ends.T:  # the two views of the edge, at every level
        shares = [np.where(found.per_view == end, found.weights, 0).sum(axis=0) for found in sides]
        assert np.abs(shares[0] - shares[1]).max() <= jump + way


@each_kind
@every_level
def test_hc04_a_view_close_to_a_vertex_agrees_with_float64(level, kind, rng):
    """Within 2e-7 of float64 for the same query, 1e-7 from the vertex.

    Fails when areas come from the paper's arccosines, or volumes not of differences: mutants hc04.
    """
    views = sphere(level)
    v = normalised(views.directions + 1e-7 * unit_vectors(rng, len(views)))
    found = query(views, v, kind)
    inside_triangle = side_distances(found.v, found.corners).min(axis=1) >= 0  # outside it the weights are clamped
    assert inside_triangle.mean() > 0.3
    assert np.isfinite(found.weights).all()
    exact = exact_weights(kind, found.v, found.corners)
    assert np.abs(found.weights - exact)[:, inside_triangle].max() <= 2e-7


@each_kind
@every_level
def test_hc05_there_is_always_a_triangle_and_its_weights_sum_to_one(level, kind, rng):
    """20 000 random views, a point on every edge, every vertex: Σw = 1 ± 2e-7 and no weight below zero.

    Fails when the weights are not clamped, or not normalised: mutants hc05.
    """
    views = sphere(level)
    v = np.concatenate([unit_vectors(rng, 20_000), edge_points(views, rng)[0], views.directions])
    found = query(views, v, kind)
    assert side_distances(found.v, found.corners).min() > -2e-7
    assert np.abs(found.weights.sum(axis=0) - 1).max() <= 2e-7
    assert found.weights.min() >= 0


@every_level
def test_hc06_the_triangle_found_is_the_one_that_contains_the_view(level, rng):
    """Not one misplaced: a view that is clear of every side in float64 lies inside the triangle found.

    Inside one triangle of a partition is outside all others, so that this is the answer of brute force. At levels 0
    to 2 brute force is run as well.
    Fails when the nearest centroid is taken, or a cap is a rounding too narrow: mutants hc06.
    """
    views = sphere(level)
    v = np.concatenate([unit_vectors(rng, 20_000), edge_points(views, rng)[0], views.directions])
    found = query(views, v, "gnomonic")
    assert side_distances(found.v, found.corners).min() > -2e-7
    if level > 2:
        return
    v = as_float32(unit_vectors(rng, 2000))
    corners = as_float32(views.directions)[views.triangles]
    depth = np.stack([side_distances(v, np.broadcast_to(c, (len(v), 3, 3))).min(axis=1) for c in corners])
    clear = np.sort(depth, axis=0)[-1] > 2e-7
    assert clear.mean() > 0.99
    located = query(views, v, "gnomonic").triangle[clear]
    assert np.array_equal(located, views.triangles[depth.argmax(axis=0)[clear]])


@pytest.mark.parametrize("count", [4, 5, 6, 9])
def test_hc06_triangles_as_wide_as_a_hemisphere_are_found_too(count, rng):
    """A handful of views of the user's own, whose triangles fill up to half the sphere: not one misplaced.

    Fails when a cap wider than a hemisphere is taken for convex: mutant hc06.
    """
    for _ in range(20):
        try:
            views = from_directions(unit_vectors(rng, count))
        except InputError:  # all in one half of the sphere
            continue
        found = query(views, unit_vectors(rng, 5000), "gnomonic")
        assert side_distances(found.v, found.corners).min() > -2e-7


@pytest.mark.parametrize("warp", [None, NormalWarp, NoWarp], ids=["mirror", "normal", "none"])
@pytest.mark.parametrize("name", METHODS)
def test_hc07_a_constant_field_stays_constant(name, warp, rng):
    """The blend of a white furnace is 1 ± 2e-7 for every method, warp and view.

    Fails when the blend is not divided by the sum of the faded weights: mutant hc07.
    """
    options = METHODS[name] | ({"warp": warp} if warp else {})
    made = method(lambda frame, n: np.ones((n, n, 3), np.float32), 32, **options)
    for view in [*unit_vectors(rng, 10), made.viewpoints.directions[3], [0, 1, 0], [0, -1, 0]]:
        assert np.abs(image(made, view_frame(view), 32)[inside(32)] - 1).max() <= 2e-7


@each_kind
def test_hc08_a_harmonic_converges_at_second_order(kind, rng):
    """RMS of a blended degree-2 harmonic: .199 .062 .0164 .0042 .00105 .00026, order 2 ± 0.15 from level 1 on.

    20 000 random views: the RMS is sure to 1 %. From the icosahedron to level 1 the order is 1.7, before the asymptote.
    Fails when the weights are given to the wrong corners: mutant hc08.
    """
    v = unit_vectors(rng, 20_000)

    def harmonic(d):
        return 1.5 * d[..., 1] ** 2 - 0.5

    rms = []
    for level in LEVELS:
        found = query(sphere(level), v, kind)
        blended = np.einsum("kn,nk->n", found.weights, harmonic(found.corners))
        rms.append(np.sqrt(np.mean((blended - harmonic(found.v)) ** 2)))
    order = np.log2(np.array(rms[:-1]) / rms[1:])
    assert rms == pytest.approx([0.199, 0.062, 0.0164, 0.0042, 0.00105, 0.00026], rel=0.05)
    assert np.abs(order[1:] - 2).max() < 0.15

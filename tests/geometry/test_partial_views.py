"""Views that do not surround the sphere."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.partial_views import covers, edges_of
from rsibr.geometry.spherical import area_weights
from rsibr.geometry.viewpoints import icosphere, partial_views


def half_sphere():
    directions = icosphere(1).directions
    return partial_views(directions[directions[:, 1] > -0.1])


def held(views, asked):
    indices, shares = views.on_device.held(mi.Vector3f(np.asarray(asked, np.float32).T), area_weights)
    return np.array(indices).T, np.stack([np.array(share) for share in shares], axis=1)


def test_views_that_surround_the_sphere_are_whole():
    whole, known = partial_views(icosphere(1).directions), icosphere(1)
    assert not whole.is_partial
    assert whole.covered == pytest.approx(1)
    assert {tuple(sorted(face)) for face in whole.triangles} == {tuple(sorted(face)) for face in known.triangles}


def test_half_a_sphere_holds_half_of_the_views():
    views = half_sphere()
    assert views.is_partial
    assert 0.4 < views.covered < 0.6
    assert np.degrees(views.largest_circumradius) < 35
    assert views.covers([[0, 1, 0], [0, -1, 0]]).tolist() == [True, False]


def test_inside_the_shares_are_those_of_the_triangle_and_outside_those_of_the_nearest_point():
    views = half_sphere()
    rng = np.random.default_rng(3)
    asked = rng.normal(size=(500, 3))
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    indices, shares = held(views, asked)
    inside = covers(views.directions, views.triangles, asked)
    point = (views.directions[indices] * shares[..., None]).sum(axis=1)
    point /= np.linalg.norm(point, axis=1, keepdims=True)
    assert np.allclose(shares.sum(axis=1), 1, atol=1e-5)
    away = np.degrees(np.arccos(np.clip((point * asked).sum(axis=1), -1, 1)))
    assert away[inside].max() < 3  # of area weights, and of the margin about edges
    # Outside: no point of any edge, sampled finely, is nearer
    a, b = (views.directions[end] for end in edges_of(views.directions, views.triangles).T)
    along = np.linspace(0, 1, 101)[:, None, None]
    arcs = a * (1 - along) + b * along
    arcs /= np.linalg.norm(arcs, axis=-1, keepdims=True)
    nearest = np.degrees(np.arccos(np.clip((arcs.reshape(-1, 3) @ asked.T).max(axis=0), -1, 1)))
    assert np.abs(away - nearest)[~inside].max() < 0.5
    assert ((shares[~inside] > 1e-6).sum(axis=1) <= 2).all()


def test_a_ring_covers_the_arcs_between_its_views():
    turn = np.radians(np.arange(0, 360, 30))
    ring = partial_views(np.stack([np.cos(turn), 0.02 * np.cos(5 * turn), np.sin(turn)], axis=1))
    assert len(ring.triangles) == 0
    assert len(edges_of(ring.directions, ring.triangles)) == 12
    indices, shares = held(ring, [[np.cos(0.2), 0.0, np.sin(0.2)], [np.cos(0.2), 2.0, np.sin(0.2)]])
    assert set(indices[0]) == set(indices[1]) == {0, 1}
    assert shares[0, list(indices[0]).index(1)] == pytest.approx(0.2 / np.radians(30), abs=0.02)


def test_a_small_circle_is_filled_and_single_views_answer_for_themselves():
    turn = np.radians(np.arange(0, 360, 60))
    cap = np.stack([0.5 * np.cos(turn), np.full(6, np.sqrt(0.75)), 0.5 * np.sin(turn)], axis=1)
    views = partial_views(cap)
    assert len(views.triangles) == 4
    assert np.degrees(views.largest_circumradius) == pytest.approx(30)
    assert views.covers([[0, 1, 0]]).all()
    alone = partial_views([[0, 0, 1]])
    indices, shares = held(alone, [[0, 1, 0]])
    assert set(indices[0]) == {0}
    assert shares.sum() == pytest.approx(1)


def test_the_nearest_view_is_found_as_on_a_whole_sphere():
    views = half_sphere()
    asked = np.array([[0.1, -1.0, 0.2], [0.0, 1.0, 0.1]])
    found = np.array(views.on_device.nearest(dr.normalize(mi.Vector3f(asked.T.astype(np.float32)))))
    assert found.tolist() == (asked @ views.directions.T).argmax(axis=1).tolist()


@pytest.mark.parametrize("triangles", [[[0, 2, 1]], [[0, 1, 9]], [[0, 1, 2], [0, 1, 2]]])
def test_triangles_that_do_not_fit_are_refused(triangles):
    with pytest.raises(InputError):
        partial_views([[1, 0, 0], [0, 1, 0], [0, 0, 1]], triangles)

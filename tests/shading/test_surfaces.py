"""Normals that are safe to shade: one triangle with given vertex normals, against closed forms."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.shading.scenes.mesh_file import as_shape
from rsibr.shading.scenes.mesh_repair import TriangleMesh
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import LEAST_COSINE, above_horizon, first_surfaces

TRIANGLE = np.array([[-1.0, -1, 0], [2, -1, 0], [-1, 2, 0]])  # in the plane z = 0, facing +z


def _seen(normal, v):
    """Surface at the origin with one normal at all vertices, seen from the unit direction `v`."""
    mesh = TriangleMesh(TRIANGLE, np.array([[0, 1, 2]]), np.tile(np.asarray(normal, float), (3, 1)))
    scene = ObjectScene("triangle", {"triangle": as_shape(mesh, "triangle")})
    v = np.asarray(v, float) / np.linalg.norm(v)
    seen = first_surfaces(scene.geometry, mi.Ray3f(mi.Point3f((3 * v).tolist()), mi.Vector3f((-v).tolist())))
    dr.eval(seen)  # while the scene exists
    dr.sync_thread()
    return seen, v


def _vector(n):
    return np.array(n).ravel()


def _flags(seen):
    return tuple(bool(getattr(seen, name)[0]) for name in ("replaced", "flipped", "bent", "is_back"))


def test_a_good_normal_stays_as_it_is():
    n = np.array([0.3, -0.2, 1]) / np.linalg.norm([0.3, -0.2, 1])
    seen, v = _seen(n, (0, 0.4, 1))
    np.testing.assert_allclose(_vector(seen.n), n, atol=1e-6)
    np.testing.assert_allclose(_vector(seen.v), v, atol=1e-6)
    assert _flags(seen) == (False, False, False, False)
    assert seen.distance[0] == pytest.approx(3, rel=1e-6)
    np.testing.assert_allclose(_vector(seen.p), 0, atol=1e-6)


def test_a_flipped_normal_is_turned():
    n = np.array([0.3, -0.2, 1]) / np.linalg.norm([0.3, -0.2, 1])
    seen, _ = _seen(-n, (0, 0.4, 1))
    np.testing.assert_allclose(_vector(seen.n), n, atol=1e-6)
    assert _flags(seen) == (False, True, False, False)


def test_from_behind_the_normal_is_that_of_the_side_which_is_seen():
    n = np.array([0.3, -0.2, 1]) / np.linalg.norm([0.3, -0.2, 1])
    seen, _ = _seen(n, (0, 0.4, -1))
    np.testing.assert_allclose(_vector(seen.n), -n, atol=1e-6)
    np.testing.assert_allclose(_vector(seen.facing), [0, 0, -1], atol=1e-6)
    assert _flags(seen) == (False, False, False, True)


@pytest.mark.parametrize("normal", [(np.nan,) * 3, (0, 0, 0), (1e-30, 0, 0)])
def test_what_is_no_direction_is_replaced_by_the_geometric_normal(normal):
    seen, _ = _seen(normal, (0.5, 0, 1))
    np.testing.assert_allclose(_vector(seen.n), [0, 0, 1], atol=1e-6)
    assert bool(seen.hit[0])
    if np.isnan(normal).any():
        assert _flags(seen)[0]


def test_a_normal_that_faces_away_is_bent_to_the_horizon_in_its_plane():
    # n = 80° from z toward +x, seen from 60° toward −x: 140° apart, though on the same side of the triangle
    n = np.array([np.sin(np.radians(80)), 0, np.cos(np.radians(80))])
    seen, v = _seen(n, (-np.sin(np.radians(60)), 0, np.cos(np.radians(60))))
    bent = _vector(seen.n)
    assert bent @ v == pytest.approx(LEAST_COSINE, rel=1e-3)
    horizon = np.array([np.cos(np.radians(60)), 0, np.sin(np.radians(60))])  # at right angles to v, toward n
    np.testing.assert_allclose(bent, horizon, atol=2e-3)
    assert _flags(seen) == (False, False, True, False)


def test_a_normal_opposite_to_the_viewer_has_no_plane_and_is_bent_all_the_same():
    v = mi.Vector3f(0.36, 0.48, 0.8)
    bent = _vector(above_horizon(-v, v))
    assert np.isfinite(bent).all()
    assert np.linalg.norm(bent) == pytest.approx(1, abs=1e-6)
    assert bent @ _vector(v) == pytest.approx(LEAST_COSINE, rel=1e-3)


def test_bent_normals_vary_smoothly_and_are_unit_vectors(rng):
    n, v = (x / np.linalg.norm(x, axis=0) for x in rng.standard_normal((2, 3, 2000)))
    bent = np.array(above_horizon(mi.Vector3f(*n), mi.Vector3f(*v)))
    np.testing.assert_allclose(np.linalg.norm(bent, axis=0), 1, atol=1e-5)
    np.testing.assert_allclose((bent * v).sum(axis=0), LEAST_COSINE, atol=1e-5)
    assert np.abs((bent * np.cross(n.T, v.T).T).sum(axis=0)).max() < 1e-4  # in the plane of n and v


def test_a_miss_counts_nowhere(sphere):
    away = first_surfaces(sphere.geometry, mi.Ray3f([5, 5, 5], [0, 1, 0]))
    assert not bool(away.hit[0])
    assert _flags(away) == (False, False, False, False)


def test_smooth_normals_of_a_torus_are_exact(torus):
    grid = np.random.default_rng(3).uniform(-1.4, 1.4, (400, 2))
    origin = mi.Point3f(*np.stack([grid[:, 0], 0 * grid[:, 0] + 4, grid[:, 1]]).astype(np.float32))
    seen = first_surfaces(torus.geometry, mi.Ray3f(origin, mi.Vector3f(0, -1, 0)))
    hit = np.array(seen.hit)
    p, n = np.array(seen.p).T[hit], np.array(seen.n).T[hit]
    ring = p * [1, 0, 1] / np.linalg.norm(p * [1, 0, 1], axis=1, keepdims=True)
    exact = (p - ring) / np.linalg.norm(p - ring, axis=1, keepdims=True)
    assert hit.sum() > 200
    assert np.degrees(np.arccos(np.clip((n * exact).sum(axis=1), -1, 1))).max() < 0.5

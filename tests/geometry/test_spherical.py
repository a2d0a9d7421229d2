"""Solid angles and weights against closed forms and float64."""

import numpy as np
import pytest

from rsibr.geometry.spherical import area_weights, gnomonic_weights, solid_angle
from rsibr.geometry.viewpoints import icosphere
from tests.arrays import to_numpy, vector

WEIGHTS = [area_weights, gnomonic_weights]


def excess_float64(a, b, c):
    """Spherical excess by L'Huilier's theorem: another formula than the one under test."""
    sides = [2 * np.arcsin(np.linalg.norm(p - q, axis=-1) / 2) for p, q in ((b, c), (c, a), (a, b))]
    s = sum(sides) / 2
    product = np.tan(s / 2) * np.prod([np.tan((s - side) / 2) for side in sides], axis=0)
    return 4 * np.arctan(np.sqrt(np.maximum(product, 0)))


def test_octant_has_an_eighth_of_the_sphere():
    x, y, z = (vector([row]) for row in np.eye(3))
    assert to_numpy(solid_angle(x, y, z)) == pytest.approx(np.pi / 2, abs=1e-6)
    assert to_numpy(solid_angle(x, z, y)) == pytest.approx(-np.pi / 2, abs=1e-6)


@pytest.mark.parametrize("subdivision", range(6))
def test_solid_angle_keeps_its_precision_on_small_triangles(subdivision):
    views = icosphere(subdivision)
    corners = [views.directions[views.triangles[:, k]] for k in range(3)]
    # the comparison takes the float32 corners as exact, so that only the formula's own error counts
    rounded = [c.astype(np.float32).astype(np.float64) for c in corners]
    got = to_numpy(solid_angle(*(vector(c) for c in corners)))
    assert np.abs(got / excess_float64(*rounded) - 1).max() < 2e-6
    assert got.sum(dtype=np.float64) == pytest.approx(4 * np.pi, rel=1e-6)


@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("subdivision", [0, 3])
def test_weights_are_one_hot_at_a_vertex(weights, subdivision):
    views = icosphere(subdivision)
    a, b, c = (vector(views.directions[views.triangles[:, k]]) for k in range(3))
    assert np.array_equal(to_numpy(weights(a, a, b, c)), np.tile([[1.0], [0.0], [0.0]], len(views.triangles)))
    assert np.array_equal(to_numpy(weights(b, a, b, c)), np.tile([[0.0], [1.0], [0.0]], len(views.triangles)))


@pytest.mark.parametrize("weights", WEIGHTS)
def test_weights_agree_with_float64_inside_a_triangle(weights, rng):
    views = icosphere(0)
    a, b, c = views.directions[views.triangles[7]]
    shares = rng.dirichlet([1, 1, 1], size=1000)
    v = shares @ np.stack([a, b, c])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    opposite = [(b, c), (c, a), (a, b)]
    if weights is area_weights:
        exact = np.stack(
            [excess_float64(v, np.broadcast_to(p, v.shape), np.broadcast_to(q, v.shape)) for p, q in opposite]
        )
    else:
        exact = np.stack([np.linalg.det(np.stack([v, *np.broadcast_arrays(p, q, v)[:2]], axis=1)) for p, q in opposite])
    exact /= exact.sum(axis=0)
    got = to_numpy(weights(vector(v), *(vector(np.tile(corner, (1000, 1))) for corner in (a, b, c))))
    assert np.abs(got - exact).max() < 1e-6


def test_gnomonic_weights_are_continuous_across_edges_where_area_weights_jump():
    """Hard case 3's facts: an edge's two triangles give its points other area weights."""
    views = icosphere(2)
    triangles_of = {}
    for triangle in views.triangles:
        for i, j, k in (triangle, np.roll(triangle, 1), np.roll(triangle, 2)):
            triangles_of.setdefault(frozenset((i, j)), []).append((i, j, k))
    sides = np.array(list(triangles_of.values()))  # edge, side of it, (i, j, apex); the edge runs i→j here, j→i there
    v = views.directions[sides[:, 0, 0]] + 0.8 * views.directions[sides[:, 0, 1]]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    jump = {}
    for weights in WEIGHTS:
        one, other = (
            to_numpy(weights(vector(v), *(vector(views.directions[sides[:, s, n]]) for n in range(3)))) for s in (0, 1)
        )
        jump[weights] = np.abs(one[:2] - other[1::-1]).max()
    assert jump[gnomonic_weights] < 2e-6
    assert 1e-4 < jump[area_weights] < 1.4e-3


@pytest.mark.parametrize("weights", WEIGHTS)
def test_weights_do_not_depend_on_the_orientation_of_space(weights, rng):
    corners = icosphere(1).directions[icosphere(1).triangles[5]]
    v = corners.mean(axis=0) / np.linalg.norm(corners.mean(axis=0))
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    plain = to_numpy(weights(*(vector([row]) for row in (v, *corners))))
    rotated = to_numpy(weights(*(vector([rotation @ row]) for row in (v, *corners))))
    assert np.abs(plain - rotated).max() < 2e-6

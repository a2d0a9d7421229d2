"""Views on the sphere and the triangle around a direction, against brute force in float64."""

import numpy as np
import pytest
import trimesh

from rsibr.errors import InputError
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import VIEW_COUNTS, first_views, from_directions, icosphere
from tests.arrays import to_numpy, unit_vectors, vector


def least_barycentric(views, triangle, v):
    """Smallest of the three side distances of v to `triangle`, in float64: at least −rounding if v lies inside."""
    corners = views.directions[views.triangles[triangle]]
    sides = []
    for k in range(3):
        p, q = corners[:, k], corners[:, (k + 1) % 3]
        normal = np.cross(p, q)
        sides.append((normal * v).sum(1) / np.linalg.norm(normal, axis=1))
    return np.min(sides, axis=0)


@pytest.mark.parametrize(("subdivision", "count"), [(0, 12), (1, 42), (2, 162), (3, 642), (4, 2562), (5, 10242)])
def test_icosphere_counts(subdivision, count):
    views = icosphere(subdivision)
    assert len(views) == count
    assert len(views.triangles) == 20 * 4**subdivision
    assert np.abs(np.linalg.norm(views.directions, axis=1) - 1).max() < 1e-12


@pytest.mark.parametrize("subdivision", range(4))
def test_icospheres_are_nested(subdivision):
    """Bit for bit, so that a view that two of them share has the same frame, and the same samples of the same seed."""
    views, finer = icosphere(subdivision), icosphere(subdivision + 1)
    count = len(views)
    assert count == VIEW_COUNTS[subdivision]
    assert np.array_equal(views.directions, finer.directions[:count])
    first = first_views(finer, count)
    assert np.array_equal(first.triangles, views.triangles)
    assert first_views(finer, len(finer)) is finer


def test_views_of_ones_own_have_no_first_ones(rng):
    views = from_directions(unit_vectors(rng, 50))
    assert first_views(views, 50) is views
    for count in (12, 13):
        with pytest.raises(ValueError, match=r"icosphere|not in"):
            first_views(views, count)


@pytest.mark.parametrize("subdivision", range(6))
def test_located_triangle_contains_the_direction(subdivision, rng):
    views = icosphere(subdivision)
    edges = views.directions[views.triangles[:, 0]] + views.directions[views.triangles[:, 1]]
    v = np.concatenate([unit_vectors(rng, 20_000), views.directions, edges])
    v = (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32)
    located = np.array(views.on_device.grid.locate(vector(v)))
    assert least_barycentric(views, located, v.astype(np.float64)).min() > -2e-7


def test_located_triangle_is_the_one_that_brute_force_finds(rng):
    views, v = icosphere(2), unit_vectors(rng, 2000).astype(np.float32)
    all_depths = np.stack([least_barycentric(views, np.full(len(v), t), v.astype(float)) for t in range(320)])
    clear = np.sort(all_depths, axis=0)[-1] > 1e-6  # on an edge both neighbours are right
    assert np.array_equal(np.array(views.on_device.grid.locate(vector(v)))[clear], all_depths.argmax(axis=0)[clear])


def test_nearest_view_is_the_one_that_brute_force_finds(rng):
    views, v = icosphere(1), unit_vectors(rng, 2000)
    cosines = v @ views.directions.T
    clear = np.diff(np.sort(cosines, axis=1)[:, -2:], axis=1)[:, 0] > 1e-6
    assert np.array_equal(np.array(views.nearest(vector(v)))[clear], cosines.argmax(axis=1)[clear])


def test_views_of_ones_own_take_the_convex_hull(rng):
    views = from_directions(7 * unit_vectors(rng, 30))
    v = unit_vectors(rng, 5000).astype(np.float32)
    located = np.array(views.on_device.grid.locate(vector(v)))
    assert least_barycentric(views, located, v.astype(np.float64)).min() > -2e-7
    corners = views.directions[views.triangles]
    assert (np.linalg.det(corners) > 0).all()
    weights = to_numpy(gnomonic_weights(vector(v), *(views.direction(i) for i in views.surrounding(vector(v)))))
    blended = np.einsum("kn,nkj->nj", weights, views.directions[views.triangles[located]])
    blended /= np.linalg.norm(blended, axis=1, keepdims=True)
    assert np.abs(blended - v).max() < 1e-4  # flat barycentric coordinates put the point back where it was


def test_either_orientation_of_given_triangles_is_taken():
    whole = icosphere(0)
    flipped = from_directions(whole.directions, whole.triangles[:, ::-1])
    assert (np.linalg.det(flipped.directions[flipped.triangles]) > 0).all()


@pytest.mark.parametrize(
    ("directions", "triangles", "message"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], None, "direction 0 is zero"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], None, "at least four"),
        ([[1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]], None, "coincide"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], None, "of the sphere"),
        ([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], None, "one plane"),
        (icosphere(0).directions, icosphere(0).triangles[:-1], "of the sphere"),
        (icosphere(0).directions, [[0, 1, 12]], "not there"),
        (icosphere(0).directions, [], "list of"),
        ("sphere", None, "list of"),
    ],
)
def test_views_that_do_not_cover_the_sphere_are_refused(directions, triangles, message):
    with pytest.raises(InputError, match=message):
        from_directions(directions, triangles)


@pytest.mark.parametrize("subdivision", [-1, 6])
def test_subdivision_out_of_range(subdivision):
    with pytest.raises(InputError, match="subdivision"):
        icosphere(subdivision)


def test_the_icosahedron_is_that_of_trimesh_to_the_bit():
    """Finer icospheres begin with its vertices, and stored bakes have them in this order."""
    mesh = trimesh.creation.icosphere(subdivisions=0)
    expected, made = from_directions(mesh.vertices, mesh.faces), icosphere(0)
    np.testing.assert_array_equal(made.directions, expected.directions)
    np.testing.assert_array_equal(made.triangles, expected.triangles)

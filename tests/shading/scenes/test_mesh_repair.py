"""Repair of meshes: normals against closed forms, creases, windings, faces without area."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rsibr.errors import InputError
from rsibr.shading.scenes.mesh_repair import TriangleMesh, repaired
from tests.shading.conftest import torus_mesh


def _repaired(mesh, name="part"):
    return repaired(mesh, name, "file.obj")


def _of(made) -> TriangleMesh:
    return TriangleMesh(np.asarray(made.vertices, float), np.asarray(made.faces))


def _soup(mesh: TriangleMesh) -> TriangleMesh:
    """Same triangles, each with vertices of its own, as in an STL."""
    return TriangleMesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


def _face_normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


@pytest.mark.parametrize("as_soup", [False, True])
def test_a_cube_keeps_its_edges(as_soup):
    cube = _of(trimesh.creation.box())
    mesh, notes = _repaired(_soup(cube) if as_soup else cube)
    assert notes == ()
    assert len(mesh.vertices) == 24
    for corner in range(3):
        np.testing.assert_allclose(mesh.normals[mesh.faces[:, corner]], _face_normals(mesh), atol=1e-12)


@pytest.mark.parametrize("as_soup", [False, True])
def test_a_sphere_is_smooth(as_soup):
    ball = _of(trimesh.creation.icosphere(2))
    mesh, notes = _repaired(_soup(ball) if as_soup else ball)
    assert notes == ()
    assert len(mesh.vertices) == len(ball.vertices)  # welded
    cosine = (mesh.normals * mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)).sum(axis=1)
    assert np.degrees(np.arccos(cosine.min())) < 1.0


def test_a_cylinder_is_smooth_around_and_sharp_at_its_ends():
    mesh, _ = _repaired(_of(trimesh.creation.cylinder(radius=1, height=2, sections=24)))
    is_cap = np.abs(mesh.normals[:, 2]) > 0.5
    np.testing.assert_allclose(np.abs(mesh.normals[is_cap, 2]), 1, atol=1e-9)
    side = mesh.normals[~is_cap]
    np.testing.assert_allclose(side[:, :2], mesh.vertices[~is_cap][:, :2], atol=1e-5)


def test_angle_weights_make_the_corner_of_a_roof_independent_of_its_triangulation():
    # Two planes at 30°; one of them fanned into many triangles at the common vertex
    slope = np.array([np.cos(np.radians(30)), 0, -np.sin(np.radians(30))])
    fan = [np.array([0, np.cos(t), 0]) + np.sin(t) * slope for t in np.linspace(0, np.pi, 9)]
    vertices = np.array([[0, 0, 0], [-1, 0, 0], *fan])
    faces = [[0, 2, 1], [0, 1, 10]] + [[0, k + 1, k] for k in range(2, 10)]
    mesh, _ = _repaired(TriangleMesh(vertices, np.array(faces)))
    at = mesh.normals[(mesh.vertices == 0).all(axis=1)]
    half = np.radians(15)
    np.testing.assert_allclose(np.abs(at), [[np.sin(half), 0, np.cos(half)]], atol=1e-6)


def test_normals_of_the_file_are_kept_to_the_last_bit_of_their_direction():
    torus = torus_mesh(24, 12)
    mesh, notes = _repaired(torus)
    assert notes == ()
    np.testing.assert_allclose(mesh.normals, torus.normals, atol=1e-12)


def test_normals_that_are_zero_or_nan_are_computed_and_counted():
    torus = torus_mesh(48, 24)
    normals = torus.normals.copy()
    normals[3], normals[40], normals[41, 1] = 0, np.nan, np.inf
    mesh, notes = _repaired(TriangleMesh(torus.vertices, torus.faces, normals))
    assert notes == ("'part': 3 of 1152 vertex normals are zero or no number, and computed",)
    assert ((mesh.normals * torus.normals).sum(axis=1) > 0.999).all()


def test_normals_that_are_all_zero_count_as_missing():
    cube = _of(trimesh.creation.box())
    mesh, _ = _repaired(TriangleMesh(cube.vertices, cube.faces, np.zeros_like(cube.vertices)))
    assert len(mesh.vertices) == 24


def test_flipped_normals_are_flipped_back_and_counted():
    torus = torus_mesh(48, 24)
    normals = torus.normals.copy()
    normals[[5, 6]] *= -1
    mesh, notes = _repaired(TriangleMesh(torus.vertices, torus.faces, normals))
    assert notes == ("'part': 2 of 1152 vertex normals are against their faces, and flipped",)
    np.testing.assert_allclose(mesh.normals, torus.normals, atol=1e-12)


def test_a_surface_that_is_inside_out_is_turned():
    torus = torus_mesh(24, 12)
    mesh, notes = _repaired(TriangleMesh(torus.vertices, torus.faces[:, ::-1]))
    assert notes == ("'part': it was inside out, and was turned",)
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    ring = centre * [1, 0, 1] / np.linalg.norm(centre * [1, 0, 1], axis=1, keepdims=True)
    assert (((centre - ring) * _face_normals(mesh)).sum(axis=1) > 0).all()


def test_random_windings_are_made_to_agree(rng):
    torus = torus_mesh(24, 12)
    faces = np.where(rng.random((len(torus.faces), 1)) < 0.4, torus.faces[:, ::-1], torus.faces)
    mesh, notes = _repaired(TriangleMesh(torus.vertices, faces))
    assert len(notes) == 1
    smooth, _ = _repaired(TriangleMesh(torus.vertices, torus.faces))
    np.testing.assert_allclose(np.sort(mesh.normals, axis=0), np.sort(smooth.normals, axis=0), atol=1e-9)
    assert len(mesh.vertices) == len(torus.vertices)


def test_a_moebius_strip_has_no_side_and_is_left_alone():
    t = 2 * np.pi * np.arange(24) / 24
    edge = [
        np.stack([(1 + w * np.cos(t / 2)) * np.cos(t), (1 + w * np.cos(t / 2)) * np.sin(t), w * np.sin(t / 2)], -1)
        for w in (-0.3, 0.3)
    ]
    k = np.arange(23)
    faces = np.concatenate(
        [np.stack([k, k + 1, k + 24], -1), np.stack([k + 1, k + 25, k + 24], -1), [[23, 24, 47], [24, 0, 47]]]
    )
    mesh, _ = _repaired(TriangleMesh(np.concatenate(edge), faces))
    assert len(mesh.faces) == 48
    assert np.isfinite(mesh.normals).all()


def test_faces_without_area_and_vertices_that_are_no_numbers_are_dropped_and_counted():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [1e30, 0, 0]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 0, 1], [0, 1, 4], [0, 2, 5], [1, 2, 6]])
    mesh, notes = _repaired(TriangleMesh(vertices, faces))
    assert len(mesh.faces) == 1
    assert notes == (
        "'part': 3 of 6 triangles have vertices that are no number or too large, and were dropped",
        "'part': 2 of 3 triangles have no area, and were dropped",
    )


def test_small_and_thin_triangles_stay():
    small = 1e-12 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    thin = np.array([[0, 0, 1], [1, 0, 1], [0.5, 1e-4, 1]])
    mesh, notes = _repaired(TriangleMesh(np.concatenate([small, thin]), np.array([[0, 1, 2], [3, 4, 5]])))
    assert notes == ()
    np.testing.assert_allclose(np.abs(mesh.normals), [[0, 0, 1]] * 6, atol=1e-9)


@pytest.mark.parametrize(
    "faces", [np.zeros((0, 3), int), np.array([[0, 1, 1]]), np.array([[0, 1, 3]]), np.array([[0, 1, -4]])]
)
def test_what_leaves_nothing_to_shade_is_refused(faces):
    with pytest.raises(InputError, match=r"^file\.obj: 'part' has (no triangle with an area|faces of vertices)"):
        _repaired(TriangleMesh(np.eye(3), faces))


def test_two_surfaces_that_touch_at_an_edge_are_not_blended():
    # Three faces at one edge: no two of them are one surface
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 0.1, 0], [-1, -0.1, 0]])
    mesh, _ = _repaired(TriangleMesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 1, 4]])))
    assert len(mesh.vertices) == 9

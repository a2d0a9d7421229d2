"""Points of the surface: shared vertices, refined triangles, safe normals, shapes that are not meshes."""

import mitsuba as mi
import numpy as np
import trimesh

from rsibr.shading.occlusion.surface_points import MOST_REFINED, SurfacePoints
from tests.shading.occlusion.objects import mesh_of


def test_a_fine_mesh_keeps_its_vertices():
    ball = trimesh.creation.icosphere(5)
    points = SurfacePoints.of({"ball": mesh_of(ball)}, ["ball"], 60.0)
    assert points.steps == {"ball": 1}
    assert np.allclose(points.positions, ball.vertices, atol=1e-6)
    assert np.array_equal(points.corners, ball.faces)


def test_a_coarse_mesh_is_refined_within_its_budget():
    ball = trimesh.creation.icosphere(1)
    points = SurfacePoints.of({"ball": mesh_of(ball)}, ["ball"], 1.0)
    steps = points.steps["ball"]
    assert steps > 5
    assert len(points) == len(ball.faces) * (steps + 1) * (steps + 2) // 2 <= MOST_REFINED
    assert len(points.corners) == len(ball.faces) * steps**2
    assert np.allclose(np.linalg.norm(points.normals, axis=1), 1, atol=1e-5)


def test_flat_triangles_keep_their_own_normals():
    box = trimesh.creation.box()
    points = SurfacePoints.of({"box": mesh_of(box, smooth=False)}, ["box"], 1.0)
    assert np.allclose(np.abs(points.normals).max(axis=1), 1, atol=1e-6)
    assert np.allclose((points.positions * points.normals).sum(axis=1), 0.5, atol=1e-6)


def test_bad_normals_and_positions_stay_finite():
    mesh = mesh_of(trimesh.creation.icosphere(2))
    parameters = mi.traverse(mesh)
    normals = np.array(parameters["vertex_normals"]).reshape(-1, 3)
    expected = normals[:2].copy()
    normals[0], normals[1] = np.nan, 0
    parameters["vertex_normals"] = normals.ravel()
    parameters.update()
    points = SurfacePoints.of({"ball": mesh}, ["ball"], 60.0)
    assert np.isfinite(points.normals).all()
    assert np.allclose(points.normals[:2], expected, atol=0.1)


def test_a_sphere_has_points_over_its_parameters():
    points = SurfacePoints.of({"ball": mi.load_dict({"type": "sphere"})}, ["ball"], 1.0)
    assert len(points) > 1000
    assert np.allclose(points.positions, points.normals, atol=1e-3)

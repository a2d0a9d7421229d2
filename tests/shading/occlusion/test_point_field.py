"""Fields over the surface: linear in each triangle, on coarse and fine meshes and on shapes without triangles."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr.shading.occlusion.point_field import PointField
from rsibr.shading.occlusion.surface_points import SurfacePoints
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import first_surfaces
from tests.shading.occlusion.objects import mesh_of


def rays(rng, count=400):
    d = rng.normal(size=(count, 3)).astype(np.float32)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return mi.Ray3f(mi.Point3f(*(-5 * d + 0.2 * rng.normal(size=(count, 3)).astype(np.float32)).T), mi.Vector3f(*d.T))


@pytest.mark.parametrize("kind", ["coarse", "fine", "flat", "sphere"])
def test_positions_are_reproduced(kind, rng):
    shape = {
        "coarse": lambda: mesh_of(trimesh.creation.icosphere(1)),
        "fine": lambda: mesh_of(trimesh.creation.icosphere(5)),
        "flat": lambda: mesh_of(trimesh.creation.box(), smooth=False),
        "sphere": lambda: mi.load_dict({"type": "sphere"}),
    }[kind]()
    scene = ObjectScene("test", {"other": mi.load_dict({"type": "sphere", "center": [9, 9, 9]}), "object": shape})
    points = SurfacePoints.of(scene.shapes, ["object"], 60.0 if kind == "fine" else 1.0)
    field = PointField.of(points, scene.shapes).holding(points.positions)
    ray = rays(rng)
    seen = first_surfaces(scene.geometry, ray)
    hit = np.array(seen.hit)
    assert hit.sum() > 100
    where = np.array(seen.p).T[hit]
    tolerance = {"sphere": 2e-3, "flat": 3e-3}.get(kind, 1e-4)
    on = np.array(field.on(seen, 7)).T
    assert np.abs(on[hit] - where).max() < tolerance
    assert (on[~hit] == 7).all()
    met = field.met(ray, scene.geometry.ray_intersect_preliminary(ray), dr.full(mi.Bool, True, len(hit)))
    assert np.abs(np.array(met).T[hit] - where).max() < tolerance


def test_the_other_side_and_shapes_without_points(rng):
    scene = ObjectScene("test", {"ball": mesh_of(trimesh.creation.icosphere(3))})
    field = PointField.of(SurfacePoints.of(scene.shapes, ["ball"], 1.0), scene.shapes)
    inside = mi.Ray3f(mi.Point3f([0.0, 0.1], [0.0, 0.1], 0.0), mi.Vector3f(0, 0, 1))
    seen = first_surfaces(scene.geometry, inside)
    assert np.array(seen.is_back).all()
    assert (np.array(field.on(seen, 5)) == 5).all()
    empty = PointField.of(SurfacePoints.of(scene.shapes, [], 1.0), scene.shapes)
    assert (np.array(empty.on(first_surfaces(scene.geometry, rays(rng)), 3)) == 3).all()

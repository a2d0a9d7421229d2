"""Occlusion around a lookup: convex objects and metals keep their radiance, hollows lose what they should."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr.shading.occlusion.occlusion import Occlusion
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import first_surfaces
from tests.shading.occlusion.objects import constant_light, inputs_of, mesh_of, torus

RAYS = 64


@pytest.fixture(autouse=True, scope="module")
def _few_points():
    """Fewer points than a picture needs: they cost the time of these tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rsibr.shading.occlusion.surface_points.MOST_REFINED", 2**13)
        yield


def seen(scene, origin, target, count=64):
    """Surfaces along a bundle of rays."""
    grid = (np.arange(count) + 0.5) / count - 0.5
    x, y = (0.4 * one.ravel().astype(np.float32) for one in np.meshgrid(grid, grid))
    forward = np.subtract(target, origin) / np.linalg.norm(np.subtract(target, origin))
    right = np.cross(forward, [0.31, 0.9, 0.3])
    right /= np.linalg.norm(right)
    d = forward + x[:, None] * right + y[:, None] * np.cross(forward, right)
    ray = mi.Ray3f(mi.Point3f(*map(float, origin)), dr.normalize(mi.Vector3f(*d.T.astype(np.float32))))
    return first_surfaces(scene.geometry, ray)


def occluded(scene, surfaces, matte, shine, **options):
    """Radiance over that under the open sky, which is the albedo, under a constant sky."""
    types, inputs = SurfaceTypes.assign(scene, ["*"]), [inputs_of(constant_light(), matte, shine)]
    whole = mi.Color3f(matte + shine)
    occlusion = Occlusion.of(scene, types, inputs, rays=RAYS, **options)
    shade = occlusion.shading(lambda _: whole, 0)
    return np.array(shade(surfaces)).T[np.array(surfaces.hit)] / (matte + shine)


@pytest.mark.parametrize("kind", ["sphere", "mesh"])
def test_a_convex_object_hides_nothing(kind):
    shape = mi.load_dict({"type": "sphere"}) if kind == "sphere" else mesh_of(trimesh.creation.icosphere(4))
    scene = ObjectScene("ball", {"ball": shape})
    ratio = occluded(scene, seen(scene, (0, 0, 4), (0, 0, 0)), 0.5, 0.1)
    at_rim = (np.abs(ratio - 1) > 2e-3).any(
        axis=1
    )  # mirror rays of interpolated normals that point into a flat triangle
    assert at_rim.mean() < (1e-3 if kind == "sphere" else 0.02)


def test_a_metal_is_not_touched():
    scene = ObjectScene("torus", {"torus": mesh_of(torus())})
    types, inputs = SurfaceTypes.assign(scene, ["*"]), [inputs_of(constant_light(), 0.0, 0.9)]

    def shade(_):
        return mi.Color3f(1)

    assert Occlusion.of(scene, types, inputs, rays=4).shading(shade, 0) is shade


def test_two_spheres_hide_each_other():
    """A sphere of radius 1 seen from the nearest point of another, 1 away: centre at 2, hidden share sin² = 1/4."""
    ball, other = trimesh.creation.icosphere(4), trimesh.creation.icosphere(4)
    other.apply_translation([0, 0, 3.0])
    scene = ObjectScene("balls", {"ball": mesh_of(ball), "other": mesh_of(other)})
    beside = seen(scene, (1.1, 0, 1.6), (0, 0, 1.0), 16)
    at_top = np.abs(np.array(beside.p).T[np.array(beside.hit)] - [0, 0, 1]).max(axis=1) < 0.04
    assert at_top.any()
    open_matte = occluded(scene, beside, 0.5, 0.0, bounces=0)[at_top]
    assert open_matte.mean() == pytest.approx(0.75, abs=0.02)
    # ---- One bounce from a sphere of albedo ½, whose near side is shaded too ----
    bounced = occluded(scene, beside, 0.5, 0.0, bounces=1)[at_top]
    assert 0.75 + 0.25 * 0.5 * 0.7 < bounced.mean() < 0.75 + 0.25 * 0.5


def test_a_furnace_of_white_paint_is_never_brighter_than_the_sky():
    scene = ObjectScene("torus", {"torus": mesh_of(torus())})
    ratio = occluded(scene, seen(scene, (0, 3, 3), (0, 0, 0)), 0.9, 0.1, bounces=8)
    assert ratio.max() < 1.03
    assert ratio.min() > 0.8


def test_gloss_is_dark_where_the_mirror_ray_meets_black():
    scene = ObjectScene("torus", {"torus": mesh_of(torus())})
    surfaces = seen(scene, (0, 3, 3), (0, 0, 0))
    kept = occluded(scene, surfaces, 1e-3, 0.5, gloss=False, bounces=0)
    lost = occluded(scene, surfaces, 1e-3, 0.5, bounces=0)
    assert kept.min() > 0.99
    assert 0.02 < (lost < 0.9).mean() < 0.6


def test_bad_normals_stay_finite():
    mesh = mesh_of(torus())
    parameters = mi.traverse(mesh)
    normals = np.array(parameters["vertex_normals"]).reshape(-1, 3)
    normals[::5], normals[1::7] = np.nan, 0
    parameters["vertex_normals"] = normals.ravel()
    parameters.update()
    scene = ObjectScene("torus", {"torus": mesh})
    ratio = occluded(scene, seen(scene, (0, 3, 3), (0, 0, 0)), 0.5, 0.1)
    assert np.isfinite(ratio).all()
    assert ratio.min() >= 0
    assert ratio.max() < 1.1


@pytest.mark.parametrize("away", [1e3, 1e4])
def test_a_place_far_from_the_origin_hides_nothing_more(away):
    near, far = (ObjectScene("torus", {"torus": mesh_of(torus().apply_translation((x, -x, x)))}) for x in (0.0, away))
    mean = [
        occluded(scene, seen(scene, np.add((0, 1, 4), at), at), 0.5, 0.1).mean()
        for scene, at in ((near, np.zeros(3)), (far, np.array([away, -away, away])))
    ]
    assert mean[1] == pytest.approx(mean[0], rel=0.01)

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.corner_rays import CORNERS, corner_rays, corners_of_differentials, footprint
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import LEAST_COSINE, first_surfaces
from tests.shading.analytic import DISTANCE, ball_scene, centres, directions, framing, on_ball


def traced(scene, camera, side=1.0):
    rays = camera.on_device()
    place = rays.centre(dr.arange(mi.UInt32, camera.width * camera.height))
    at = first_surfaces(scene.geometry, rays.ray(place))
    seen = footprint(scene.geometry, corner_rays(rays, place, dr.opaque(mi.Float, side)), at)
    dr.eval(at, seen)  # while the scene lives
    return at, seen


@pytest.mark.parametrize("rays_a_pixel", [1, 16])
def test_corners_of_mitsubas_differentials_are_those_of_the_camera(rays_a_pixel):
    look = mi.ScalarTransform4f().look_at([1, 2, 5], [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": 24, "height": 16}
    sensor = backend.load({"type": "perspective", "fov": 50, "to_world": look, "film": film})
    camera = Camera.of_sensor(sensor).on_device()
    place = camera.centre(dr.arange(mi.UInt32, 24 * 16)) + mi.Point2f(0.2, -0.3)
    ray, _ = sensor.sample_ray_differential(0, 0.5, place / mi.Point2f(24, 16), mi.Point2f(0.5))
    side = rays_a_pixel**-0.5
    ray.scale_differential(side)
    wanted = corner_rays(camera, place, dr.opaque(mi.Float, side))
    for one, other in zip(corners_of_differentials(ray), wanted, strict=True):
        assert np.abs(np.array(one.d) - np.array(other.d)).max() < 0.01 * side / 24


@pytest.mark.parametrize("side", [1.0, 0.25])
def test_corners_on_a_ball(side):
    camera = framing(24)
    at, seen = traced(ball_scene(), camera, side)
    hit, continued = np.array(at.hit), np.array(seen.is_extrapolated)
    right, down = (x.ravel() for x in centres(camera))
    assert hit.sum() > 400
    for k, (x, y) in enumerate(CORNERS):
        d = directions(camera, right + side * x, down + side * y)
        distance, n = on_ball(camera, d)
        known = hit & np.isfinite(distance) & ~continued
        assert known.sum() > 0.75 * hit.sum()
        assert np.allclose(np.array(seen.n[k]).T[known], n[known], atol=2e-3)
        assert np.allclose(np.array(seen.v[k]).T, -d, atol=1e-6)


def test_solid_angle_of_normals_is_the_analytic_derivative():
    """In the middle of the ball a step of one pixel, an angle δ of the ray, turns the normal by δ (d − 1)."""
    camera = framing(65)
    _, seen = traced(ball_scene(), camera)
    middle = 65 * 32 + 32
    a, b, _, d = (np.array(n)[:, middle] for n in seen.n)
    step = 2 * camera.half_width / 65 * (DISTANCE - 1)
    assert np.linalg.norm(b - a) == pytest.approx(step, rel=2e-3)
    assert np.linalg.norm(d - a) == pytest.approx(step, rel=2e-3)
    assert a[0] < b[0]
    assert a[1] > d[1]


def test_corners_beyond_the_outline_are_continued():
    camera = framing(24)
    at, seen = traced(ball_scene(), camera)
    hit, continued = np.array(at.hit), np.array(seen.is_extrapolated)
    right, down = (x.ravel() for x in centres(camera))
    misses = [np.isnan(on_ball(camera, directions(camera, right + x, down + y))[0]) for x, y in CORNERS]
    assert continued[hit & np.any(misses, axis=0)].all()
    assert continued[hit].any()
    n, v = np.array(at.n), np.array(at.v)
    for k in range(4):
        corner, view = np.array(seen.n[k])[:, hit], np.array(seen.v[k])[:, hit]
        assert np.allclose(np.linalg.norm(corner, axis=0), 1, atol=1e-5)
        assert ((corner * view).sum(axis=0) > 0.9 * LEAST_COSINE).all()
        turned = np.degrees(np.arccos(np.clip((corner * n[:, hit]).sum(axis=0), -1, 1)))
        assert turned.max() < 30  # at the outline itself, at most as far as the opposite corner
    assert np.isfinite(v).all()


def test_another_shape_does_not_count():
    """A wall behind a ball: corners that meet it are continued, although they hit."""
    wall = backend.load(
        {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -2]).scale([9, 9, 1])}
    )
    camera = framing(24)
    alone, with_wall = traced(ball_scene(), camera), traced(ball_scene(wall=wall), camera)
    hit = np.array(alone[0].hit)
    for one, other in zip(alone[1].n, with_wall[1].n, strict=True):
        assert np.allclose(np.array(one)[:, hit], np.array(other)[:, hit], atol=1e-5)


def test_a_nearer_part_of_the_same_shape_does_not_count():
    """Two balls in one mesh, one behind the other: the depth between them parts a footprint."""
    import trimesh

    near, far = trimesh.creation.icosphere(4, 0.5), trimesh.creation.icosphere(4, 1.5)
    far.apply_translation([0, 0, -3])
    both = trimesh.util.concatenate([near, far])
    mesh = mi.Mesh("both", len(both.vertices), len(both.faces), has_vertex_normals=True)
    values = mi.traverse(mesh)
    values["vertex_positions"] = both.vertices.ravel().astype(np.float32)
    values["faces"] = both.faces.ravel().astype(np.uint32)
    values["vertex_normals"] = np.concatenate([near.vertex_normals, far.vertex_normals]).ravel().astype(np.float32)
    values.update()
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), fov_deg=25, width=24, height=24)
    at, seen = traced(ObjectScene("both", {"both": mesh}), camera)
    n, hit = np.array(at.n), np.array(at.hit)
    is_far = hit & (np.array(at.distance) > 5)
    assert is_far.any()
    for corner in seen.n:  # normals of the far ball turn slowly where the near one's outline is
        turned = np.degrees(np.arccos(np.clip((np.array(corner) * n).sum(axis=0), -1, 1)))
        assert turned[is_far & (n[2] > 0.8)].max() < 12

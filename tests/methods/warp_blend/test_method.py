"""Reconstruction against an analytic mirror sphere: exact where it must be, finite everywhere, compiled once."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.spherical import area_weights, gnomonic_weights
from rsibr.geometry.viewpoints import icosphere
from rsibr.methods.warp_blend.blend import nearest_mix, triangle_mix
from rsibr.methods.warp_blend.disk_mesh import DiskMesh
from rsibr.methods.warp_blend.warp import MirrorWarp, NormalWarp, NoWarp
from rsibr.methods.warp_blend.warp_blend import MeshWarpBlend
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.scene import image, inside, matte_sphere, method, mirror_sphere, normals, stored

N = 64
METHODS = {
    "nearest": {"mix": nearest_mix, "warp": NoWarp},
    "blend": {"warp": NoWarp},
    "cabral1999": {},
    "normal": {"warp": NormalWarp},
    "gnomonic": {"mix": triangle_mix(gnomonic_weights)},
    "mesh": {"kind": MeshWarpBlend},
}
VIEWS = [[1, 2, 3], [0, 1, 0], [0, -1, 0], [-0.3, 0.2, -0.9], [1, 0, 0], [0.577, 0.577, 0.577]]


@pytest.mark.parametrize("view", VIEWS)
def test_mirror_warp_reconstructs_a_mirror(view):
    frame = view_frame(view)
    error = np.abs(image(method(resolution=128), frame, 128) - mirror_sphere(frame, 128))
    assert error[inside(128, 0.9)].max() < 0.005  # bilinear lookup of maps that stretch by 1/cos²θ toward the rim
    assert error[inside(128)].max() < 0.1
    assert error[inside(128)].mean() < 1e-3


@pytest.mark.parametrize("view", VIEWS)
def test_normal_warp_reconstructs_what_depends_on_the_normal(view):
    frame = view_frame(view)
    error = np.abs(image(method(matte_sphere, warp=NormalWarp), frame, N) - matte_sphere(frame, N))
    assert error[inside(N, 0.9)].max() < 0.01
    assert error[inside(N)].max() < 0.05


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("index", [0, 5, 11])
def test_stored_views_come_back_exactly(name, index):
    made = method(**METHODS[name])
    frame = view_frame(made.viewpoints.directions[index])
    assert np.abs(image(made, frame, N) - mirror_sphere(frame, N))[inside(N)].max() < 2e-5


@pytest.mark.parametrize("name", METHODS)
def test_a_constant_field_stays_constant(name, rng):
    """Hard case 7: the weights are a partition of unity, whatever fades."""
    made = method(lambda frame, n: np.ones((n, n, 3), np.float32), **METHODS[name])
    for view in unit_vectors(rng, 5):
        assert np.abs(image(made, view_frame(view), N)[inside(N)] - 1).max() < 3e-7


@pytest.mark.parametrize("name", METHODS)
def test_result_does_not_depend_on_the_frame_of_the_map(name):
    """Hard case 10: the same normals seen from the same view, laid out in a rolled frame (the mesh rolls with it)."""
    frame, angle = view_frame([0.3, -0.5, 0.8]), 0.7
    roll = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    made, rolled = method(**METHODS[name]), frame @ roll
    n = normals(rolled, N).reshape(-1, 3)
    v = vector(np.tile(frame[:, 2], (len(n), 1)))
    by_eval = np.array(made.eval(vector(n), v)).T.reshape(N, N, 3)
    tolerance = 1e-4 if name != "mesh" else 1.0
    assert np.abs(by_eval - image(made, rolled, N))[inside(N, 0.99)].max() < tolerance


@pytest.mark.parametrize("name", METHODS)
def test_texels_outside_the_disk_are_never_read(name):
    """Hard case 13: poison there changes not a bit."""

    def poisoned(frame, n):
        clean = mirror_sphere(frame, n)
        clean[np.hypot(*np.meshgrid(np.arange(n) - n / 2 + 0.5, np.arange(n) - n / 2 + 0.5)) > n / 2 + 0.71] = np.nan
        return clean

    for view in VIEWS:
        clean = image(method(**METHODS[name]), view_frame(view), N)
        assert np.array_equal(clean, image(method(poisoned, **METHODS[name]), view_frame(view), N))


@pytest.mark.parametrize("away", [0, 1e-7, 1e-5, 1e-3, 1e-1])
@pytest.mark.parametrize("name", METHODS)
def test_finite_and_within_range_near_a_stored_view_and_its_antipode(name, away):
    """Hard cases 4, 11, 12, 15: singularities at the rim, for views on and beside a stored one."""
    made = method(**METHODS[name])
    for sign in (1, -1):
        view = sign * made.viewpoints.directions[2] + away * np.array([0.3, -0.8, 0.52])
        got = image(made, view_frame(view), N)[inside(N)]
        assert np.isfinite(got).all()
        sources = np.stack([mirror_sphere(view_frame(d), N) for d in made.viewpoints.directions])
        assert (got >= sources.min((0, 1, 2)) - 1e-5).all()
        assert (got <= sources.max((0, 1, 2)) + 1e-5).all()


def test_exactly_at_the_singularity_the_source_drops_out():
    """Hard case 11: where r = −v_s the other two views decide, and nothing jumps on the way there."""
    made = method(resolution=128)
    stored_view = made.viewpoints.directions[0]
    v = np.array([0.2, 0.1, 0.05]) + stored_view
    v /= np.linalg.norm(v)
    n = v - stored_view
    n /= np.linalg.norm(n)
    tangent = np.cross(n, v) / np.linalg.norm(np.cross(n, v))
    offsets = np.array([0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3])
    path = n + offsets[:, None] * tangent
    path /= np.linalg.norm(path, axis=1, keepdims=True)
    got = np.array(made.eval(vector(path), vector(np.tile(v, (len(path), 1)))))
    assert np.isfinite(got).all()
    assert np.abs(np.diff(got, axis=1)).max() < 0.02


def test_antipodal_symmetry_of_views_is_not_mistaken_for_nearness():
    views, sources = stored(mirror_sphere, N)
    index = nearest_mix(views, sources, vector([-views.directions[4]])).views[0].index
    assert np.allclose(views.directions[int(np.array(index)[0])], -views.directions[4], atol=1e-6)


@pytest.mark.parametrize("subdivision", range(4))
def test_area_and_gnomonic_blend_of_a_harmonic_converges_at_second_order(subdivision, rng):
    """Hard case 8: a degree-2 harmonic, blended on the sphere of views; RMS as measured on the prototype."""
    views, v = icosphere(subdivision), unit_vectors(rng, 20_000).astype(np.float32)
    corners = [views.direction(i) for i in views.surrounding(vector(v))]

    def harmonic(d):
        return (3 * d[..., 1] ** 2 - 1) * 0.5

    for weights in (area_weights, gnomonic_weights):
        w = np.array([np.array(x) for x in weights(vector(v), *corners)])
        blended = sum(w[k] * harmonic(np.array(corners[k]).T) for k in range(3))
        rms = np.sqrt(np.mean((blended - harmonic(v.astype(float))) ** 2))
        assert rms == pytest.approx([0.199, 0.062, 0.0164, 0.0042][subdivision], rel=0.25)


def test_nothing_is_compiled_from_view_to_view_or_from_bake_to_bake():
    """Compiled once: other views, and other maps of the same count and size, find their kernels."""
    made = method()
    dr.eval(made.map(view_frame([1, 2, 3]), N))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for view in VIEWS:
            dr.eval(made.map(view_frame(view), N))
        dr.eval(method(matte_sphere).map(view_frame([3, 2, 1]), N))
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(launched) >= 2 * (len(VIEWS) + 1)
    assert all(kernel["cache_hit"] for kernel in launched)


def test_a_point_of_the_mesh_lies_in_its_triangle(rng):
    """Non-negative weights that lead back to the point, up to the chords of the outermost ring."""
    radius, turn = np.cos(np.pi / 48) * np.sqrt(rng.random(5000)), rng.uniform(-np.pi, np.pi, 5000)
    p = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    mesh = DiskMesh()
    index, share = mesh.corners(mi.Point2f(*p.T.astype(np.float32)))
    corners = np.stack([to_numpy(mesh.vertex(corner)).T for corner in index])
    share = to_numpy(share)
    assert share.min() > -1e-4
    assert np.abs((share[..., None] * corners).sum(axis=0) - p).max() < 1e-6


def test_mesh_converges_to_the_exact_warp():
    views, sources = stored(mirror_sphere, N)
    frame, errors = view_frame([0.2, 0.9, -0.4]), []
    exact = image(method(), frame, N)
    for rings in (8, 16, 32):
        made = MeshWarpBlend(
            "mesh",
            views,
            sources,
            triangle_mix(area_weights),
            MirrorWarp,
            DiskMesh(rings, 3 * rings),
        )
        errors.append(np.abs(image(made, frame, N) - exact)[inside(N, 0.9)].mean())
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_eval_takes_a_view_a_lane(rng):
    """Shading an object in perspective: every lane has its own view."""
    v, n = unit_vectors(rng, 500), unit_vectors(rng, 500)
    n[(n * v).sum(1) < 0] *= -1
    made = method(resolution=256)
    got = np.array(made.eval(vector(n), vector(v))).T
    from tests.methods.scene import sky

    exact = sky(2 * (n * v).sum(1)[:, None] * n - v)
    assert np.abs(got - exact)[(n * v).sum(1) > 0.3].max() < 0.01


def test_maps_of_other_sizes_than_the_stored_ones():
    frame = view_frame([1, 2, 3])
    assert np.abs(image(method(resolution=128), frame, 48) - mirror_sphere(frame, 48))[inside(48, 0.9)].max() < 0.01
    assert isinstance(method().map(frame, 48), mi.TensorXf)

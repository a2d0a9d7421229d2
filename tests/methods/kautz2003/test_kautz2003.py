"""The method as a whole: closed forms, its options, orientation, and what a new environment or view costs."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.integrator import SphereIntegrator
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.octahedral import texel_directions
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centres
from rsibr.light.radiance import Light, light_of
from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.band_factors import phong
from rsibr.methods.kautz2003.kautz2003 import kautz2003
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import registration
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from tests.arrays import disk_grid, to_numpy, unit_vectors, vector
from tests.lobe_shapes import one_gaussian
from tests.methods.conftest import truth
from tests.methods.kautz2003.skies import directions, faces_of, grey

AXIS = np.array([0.3, 0.6, -0.2])
PLAIN = {"f_lambda": 0.2, "k_d": 0.6, "k_s": 0.9, "bias": 0.0}
MIRROR = {"f_lambda": 1.0, "k_d": 0.0, "k_s": 1.0, "bias": 0.0}
VIEWS = ([0, 1, 0], [0, -1, 0], [0, 0, 1], [1, 2, 3], [-0.3, 0.2, -0.9], [0.5, -1, 0.3])
"""Six views, poles included."""


def gradient(d):
    return np.repeat(1 + (d @ AXIS)[..., None], 3, axis=-1)


def inputs(sky, resolution=256, albedo=0.5):
    """What the method reads of a bake with one lobe."""
    d = np.array(texel_directions(resolution), dtype=np.float64).T.reshape(resolution, resolution, 3)
    table = np.full((len(node_cosines()), 3), albedo)
    return SimpleNamespace(light=Light(sky(d).astype(np.float32)), shapes={"coat": (one_gaussian(0.1), table)})


def pairs(rng, count=300):
    n, v = unit_vectors(rng, count), unit_vectors(rng, count)
    return n, v * np.sign((n * v).sum(axis=1))[:, None]


def radiance(method, n, v):
    return to_numpy(method.eval(vector(n), vector(v))).T


def schlick(f, cosine):
    return f + (1 - f) * (1 - cosine[:, None]) ** 5


@pytest.mark.parametrize("borders", [False, True])
def test_a_constant_sky_gives_the_albedo(borders, rng):
    n, v = pairs(rng)
    f, k_d, k_s = np.array([0.04, 0.2, 0.9]), np.array([0.8, 0.3, 0.1]), np.array([1.0, 0.7, 0.9])
    sky = lambda d: np.full((*d.shape[:-1], 3), 2.0)  # noqa: E731
    made = kautz2003(inputs(sky), f_lambda=f, k_d=k_d, k_s=k_s, bias=3.3, borders=borders, size=64)
    fresnel = schlick(f, (n * v).sum(axis=1))
    assert radiance(made, n, v) == pytest.approx(2 * ((1 - fresnel) * k_d + fresnel * k_s), rel=1e-4)


def test_the_fit_keeps_the_albedo_of_the_lobes(rng):
    n, v = pairs(rng)
    made = kautz2003(inputs(lambda d: np.ones((*d.shape[:-1], 3)), albedo=0.37), size=64)
    assert made.material.albedo_error < 1e-3
    assert radiance(made, n, v) == pytest.approx(0.37, rel=3e-3)


def test_with_f_lambda_of_one_and_no_bias_it_mirrors_the_environment(rng):
    n, v = pairs(rng)
    r = 2 * (n * v).sum(axis=1)[:, None] * n - v
    made = kautz2003(inputs(gradient), **MIRROR, borders=True, size=128)
    assert radiance(made, n, v) == pytest.approx(gradient(r), abs=2e-3)


def test_schlick_mixes_lambert_and_the_glossy_lobe(rng):
    """Under 1 + a·ω: k_d (1 + 2/3 a·n), and k_s (1 + Λ_1 a·r) by Phong's lobe."""
    n, v = pairs(rng)
    cosine = (n * v).sum(axis=1)
    r = 2 * cosine[:, None] * n - v
    fresnel, exponent = schlick(0.2, cosine), 30.0
    lobe = phong(exponent, np.array([1]))[0]
    diffuse, glossy = 0.6 * (1 + 2 / 3 * n @ AXIS)[:, None], 0.9 * (1 + lobe * r @ AXIS)[:, None]
    made = kautz2003(inputs(gradient), **PLAIN, filter="phong", exponent=exponent, borders=True, size=64)
    assert radiance(made, n, v) == pytest.approx(
        np.repeat((1 - fresnel) * diffuse + fresnel * glossy, 3, axis=1), abs=4e-3
    )


def test_a_map_is_eval_at_its_texels():
    made, size = kautz2003(inputs(gradient), **PLAIN, size=32, points=1), 16
    frame = view_frame(np.array([1.0, 2, 3]) / np.sqrt(14))
    x, y = disk_grid(size)
    inside = np.hypot(x, y) < 0.9
    n = np.array(mi.Matrix3f(frame.astype(np.float32)) @ normal_from_disk(texel_centres(size))).T.reshape(size, size, 3)
    wanted = radiance(made, n[inside], np.broadcast_to(frame[:, 2], n[inside].shape))
    assert run(made, frame, size).image[inside] == pytest.approx(wanted, abs=1e-5)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("light", [[0.6, 0.48, 0.64], [-0.8, 0.0, 0.6]])
def test_the_highlight_lies_where_the_half_vector_is(view, light):
    view, light = (np.array(one) / np.linalg.norm(one) for one in (view, light))
    if view @ light < -0.9:
        pytest.skip("behind")
    sky = grey(lambda d: 0.01 + np.exp(300 * (d @ light - 1)))
    made, size = kautz2003(inputs(sky), **MIRROR, size=128), 96
    frame = view_frame(view)
    image = run(made, frame, size).image[..., 0]
    row, column = np.unravel_index(np.argmax(image), image.shape)
    x, y = disk_grid(size)
    x, y = x[row, column], y[row, column]
    n = frame @ [x, y, np.sqrt(max(1 - x * x - y * y, 0))]
    half = (view + light) / np.linalg.norm(view + light)
    assert np.degrees(np.arccos(min(n @ half, 1))) < 3


def test_directions_are_those_of_the_renderer(asymmetric_environment, rng):
    """The faces of a file show in each direction what the renderer's emitter shows there."""
    environment = load_environment(EnvironmentConfig(file=asymmetric_environment))
    made = kautz2003(
        SimpleNamespace(light=light_of(environment, with_image=False), shapes=inputs(gradient, 16).shapes),
        **MIRROR,
        size=128,
    )
    d = unit_vectors(rng, 500)
    si = dr.zeros(mi.SurfaceInteraction3f, len(d))
    si.wi = vector(-d)
    wanted = to_numpy(mi.load_dict(environment.emitter()).eval(si)).T
    assert radiance(made, d, d) == pytest.approx(wanted, abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("borders", [False, True])
def test_the_highlight_lies_where_the_path_tracer_has_it(small_bakes, asymmetric_environment, borders):
    made = MethodSet(small_bakes("rough-aluminium")).variant("kautz2003", borders=borders)
    light = load_environment(EnvironmentConfig(file=asymmetric_environment)).emitter()
    integrator = SphereIntegrator(light, load_material(MaterialConfig(preset="rough-aluminium")).bsdf(), 48)
    for index, view in enumerate(VIEWS):
        frame, covered, wanted, _ = truth(integrator, view_frame(np.array(view) / np.linalg.norm(view)), index)
        found = run(made, frame, 48).image[covered]
        errors = {
            name: _relative(turned[covered], wanted) for name, turned in _turned(run(made, frame, 48).image).items()
        }
        assert _relative(found, wanted) < 0.35
        assert _relative(found, wanted) < 0.7 * min(errors.values())


def _turned(image):
    return {"mirrored": image[:, ::-1], "upside down": image[::-1], "turned": image[::-1, ::-1]}


def _relative(found, wanted):
    return np.sqrt(np.mean((found - wanted) ** 2) / np.mean(wanted**2))


def test_another_view_and_another_light_compile_nothing():
    made = kautz2003(inputs(gradient), **PLAIN, size=32)
    other = kautz2003(inputs(gradient), **{**PLAIN, "bias": 1.7, "k_d": 0.1}, size=32)
    faces = faces_of(gradient, 32)
    frames = [view_frame(np.array(view) / np.linalg.norm(view)) for view in VIEWS]
    for method in (made, made.refiltered(faces)):
        run(method, frames[0], 24)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        kernels = [_kernels(method, frame) for frame in frames for method in (made, other, made.refiltered(2 * faces))]
    assert kernels[0]
    assert all(found == kernels[0] for found in kernels)


def _kernels(method, frame):
    """Hashes of the kernels that a map launches, in which constants show; none is compiled."""
    dr.kernel_history_clear()
    run(method, frame, 24)
    launched = dr.kernel_history([dr.KernelType.JIT])
    assert all(one["cache_hit"] for one in launched)
    return {one["hash"] for one in launched}


@pytest.mark.parametrize("filtering", [{}, {"filter": "phong", "exponent": 5.0}, {"borders": True}])
def test_a_new_environment_replaces_the_old_one(filtering, rng):
    n, v = pairs(rng, 50)
    made = kautz2003(inputs(gradient), **{**PLAIN, "bias": 1.5}, **filtering, size=32)
    before = radiance(made, n, v)
    sky = grey(lambda d: 2 - d @ AXIS)
    found = radiance(made.refiltered(faces_of(sky, 32)), n, v)
    anew = kautz2003(inputs(sky), **{**PLAIN, "bias": 1.5}, **filtering, size=32)
    assert found == pytest.approx(radiance(anew, n, v), abs=5e-3)
    assert np.abs(found - before).max() > 0.3
    assert radiance(made, n, v) == pytest.approx(before)


def test_what_is_given_replaces_what_is_fitted():
    fitted = kautz2003(inputs(gradient), size=32).material
    given = kautz2003(inputs(gradient), bias=2.5, f_lambda=[0.1, 0.2, 0.3], size=32).material
    assert (given.bias, given.f_lambda.tolist()) == (2.5, [0.1, 0.2, 0.3])
    assert (given.exponent, given.k_s.tolist()) == (fitted.exponent, fitted.k_s.tolist())


def test_options_that_cannot_be_are_refused():
    for options, message in (
        ({"filter": "pong"}, "Did you mean 'phong'"),
        ({"filter": "phong", "exponent": 0.0}, "number above 0"),
        ({"bias": "high"}, "'high' is no bias"),
        ({"size": 100}, "power of two"),
        ({"size": 2**20}, "up to 2048"),
        ({"coefficients_face": 0}, "power of two"),
        ({"f_lambda": [0.1, 1.2, 0.1]}, r"in \[0, 1\]"),
        ({"k_d": [0.1, 0.2]}, "one number or three"),
        ({"borders": "yes"}, "true or false"),
    ):
        with pytest.raises(InputError, match=message):
            kautz2003(inputs(gradient, 16), **options)


def test_lights_without_extent_are_refused():
    found = registration("kautz2003")
    assert not found.sees_delta_lights
    assert found.needs.light


def test_few_texels_a_face_serve_too(rng):
    light = KautzLight.of(faces_of(gradient, 4), coefficients_face=8)
    assert to_numpy(light.diffuse.mean_radiance(vector(directions(2).reshape(-1, 3))))[0] == pytest.approx(
        1 + 2 / 3 * directions(2).reshape(-1, 3) @ AXIS, abs=0.02
    )

"""The method on analytic lights: closed forms, orientation, lights without extent, options."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.miller1984.miller1984 import miller1984 as method_of
from rsibr.methods.registry import registration
from tests.arrays import unit_vectors
from tests.methods.miller1984.scene import glossy, inputs, light, matte, mirror, one_light, sky
from tests.methods.scene import image, inside, normals
from tests.scene.maps import BLOBS

SIX = ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1])
RESOLUTION = 64


def miller1984(made_of, *, illumination_rows=144, **options):
    """The method with a smaller table of the light than by default."""
    return method_of(made_of, illumination_rows=illumination_rows, **options)


def vectors(directions):
    return mi.Vector3f(np.ascontiguousarray(np.asarray(directions, dtype=np.float32).T))


def pairs(rng, count):
    n = unit_vectors(rng, count)
    v = n + 0.9 * unit_vectors(rng, count)
    return n, v / np.linalg.norm(v, axis=1, keepdims=True)


def radiance(method, n, v):
    return np.array(method.eval(vectors(n), vectors(v))).T


def grey(d):
    return np.full((len(d), 3), 2.0)


@pytest.mark.parametrize(
    "lobes",
    [[matte(0.8, 0.4, 0.1)], [glossy(0.1)], [mirror()], [matte(0.3, 0.3, 0.3), glossy(0.05), mirror((0.1, 0.1, 0.1))]],
    ids=["matte", "glossy", "mirror", "varnished"],
)
def test_a_constant_sky_gives_the_albedo(lobes, rng):
    method = miller1984(inputs(light(grey), *lobes))
    n, v = pairs(rng, 200)
    cosine = np.sqrt(np.maximum((n * v).sum(axis=1), 0))
    albedo = sum(np.interp(cosine, [0, 1], [1, 0.6])[:, None] * table[0] for _, table in lobes)
    assert np.allclose(radiance(method, n, v), 2 * albedo, rtol=4e-3)
    assert radiance(method, n, v).mean() == pytest.approx(2 * albedo.mean(), rel=1e-3)


def test_lambert_under_a_gradient(gradient_axis, rng):
    """ρ (1 + 2/3 a·N), within a bilinear lookup at 5° texels."""
    a = gradient_axis
    method = miller1984(inputs(light(lambda d: 1 + (d @ a)[:, None]), matte(0.5, 0.5, 0.5)))
    n, v = pairs(rng, 300)
    albedo = 0.5 * np.interp(np.sqrt(np.maximum((n * v).sum(axis=1), 0)), [0, 1], [1, 0.6])
    closed = albedo * (1 + 2 / 3 * n @ a)
    assert np.allclose(radiance(method, n, v), closed[:, None], rtol=2e-3)


@pytest.mark.parametrize("view", SIX)
def test_a_mirror_shows_the_environment_from_six_views(view):
    """Every texel, by a reflection of its own; poles of the tables included."""
    frame = view_frame(view)
    method = miller1984(inputs(light(sky, 512), mirror()), w_s=[1.0, 1.0], illumination_rows=252, points=1)
    n, v = normals(frame, RESOLUTION), frame[:, 2]
    expected = sky(2 * (n @ v)[..., None] * n - v)
    seen = inside(RESOLUTION, 0.97)
    assert np.abs(image(method, frame, RESOLUTION) - expected)[seen].max() < 0.05
    assert np.abs(image(method, frame, RESOLUTION) - expected)[seen].mean() < 2e-3


@pytest.mark.parametrize("view", SIX)
def test_a_highlight_is_where_its_light_is_reflected(view):
    """Of each light in front: the brightest texel of its colour reflects it, to two texels of the map."""
    frame = view_frame(view)
    method = miller1984(inputs(light(sky), glossy(0.03)), w_s=[1.0, 1.0])
    found, v = image(method, frame, 96), frame[:, 2]
    n, seen = normals(frame, 96), inside(96, 0.9)
    for axis, colour in BLOBS.items():
        half = np.array(axis) + v
        if np.linalg.norm(half) < 0.6 or colour[0] == colour[1]:
            continue  # behind the sphere, or not of one colour
        channel = int(np.argmax(colour))
        own = found[..., channel] - np.delete(found, channel, axis=-1).max(axis=-1)
        brightest = n[seen][np.argmax(own[seen])]
        assert np.linalg.norm(brightest - half / np.linalg.norm(half)) < 3 * 2 / 96


def test_a_light_without_extent_against_the_closed_form(rng):
    """Lambert ρ/π E max(N·L, 0), and Phong k_s E (R·L)ⁿ/4π, within half a texel of the illumination table."""
    direction = np.array([0.4, 0.7, -0.59])
    direction /= np.linalg.norm(direction)
    n, v = pairs(rng, 400)
    lit = inputs(one_light(direction, [1, 2, 3]), matte(0.5, 0.5, 0.5))
    found = radiance(miller1984(lit, w_d=[1, 1], k_d=2.0, diffuse_rows=72, illumination_rows=504), n, v)
    closed = 2 * np.maximum(n @ direction, 0)[:, None] * [1, 2, 3] / (4 * np.pi)
    assert np.abs(found - closed).max() < 0.015 * closed.max()
    lit = inputs(one_light(direction, [1, 2, 3]), glossy(0.1))
    found = radiance(miller1984(lit, w_s=[1, 1], k_s=3.0, n=40.0, specular_rows=126, illumination_rows=504), n, v)
    r = 2 * (n * v).sum(axis=1, keepdims=True) * n - v
    closed = 3 * np.maximum(r @ direction, 0)[:, None] ** 40 * [1, 2, 3] / (4 * np.pi)
    assert np.abs(found - closed).max() < 0.02 * closed.max()
    assert registration("miller1984").sees_delta_lights


def test_nearest_lookups_have_steps_and_bilinear_ones_do_not(gradient_axis):
    """Along a meridian, where a step of a texel's width is 5°."""
    lit = inputs(light(lambda d: 1 + (d @ gradient_axis)[:, None]), matte(1, 1, 1))
    turn = np.linspace(0.3, 2.8, 700)
    n = np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    steps = {}
    for lookup in ("nearest", "bilinear"):
        found = radiance(miller1984(lit, lookup=lookup, w_d=[1, 1]), n, n)[:, 0]
        steps[lookup] = np.abs(np.diff(found))
    assert (steps["nearest"] > 1e-6).sum() < 40
    assert steps["nearest"].max() > 5 * steps["bilinear"].max()


def test_a_self_luminous_material_looks_the_same_all_over(rng):
    method = miller1984(inputs(light(sky), matte(1, 1, 1)), diffuse="self-luminous", w_d=[1, 1])
    found = radiance(method, *pairs(rng, 50))
    assert np.allclose(found, found[0], rtol=1e-5)


def test_from_the_second_view_on_nothing_is_compiled(rng):
    method = miller1984(inputs(light(sky), matte(0.5, 0.5, 0.5), glossy(0.1)))
    first, *others = [view_frame(v) for v in unit_vectors(rng, 5)]
    dr.eval(method.map(first, RESOLUTION))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for frame in others:
            dr.eval(method.map(frame, RESOLUTION))
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)


def test_a_texel_shows_the_mean_over_its_points():
    """Of a mirror under a narrow light: four points a texel are the mean of the map of twice the resolution."""
    frame, lit = view_frame([1, 2, 3]), inputs(light(sky), mirror())
    coarse = image(miller1984(lit, points=2), frame, 32)
    fine = image(miller1984(lit, points=1), frame, 64).reshape(32, 2, 32, 2, 3).mean(axis=(1, 3))
    whole = inside(32, 0.9)
    assert np.allclose(coarse[whole], fine[whole], rtol=1e-3, atol=1e-4)
    assert not np.allclose(image(miller1984(lit, points=1), frame, 32)[whole], fine[whole], rtol=0.05)


def test_constants_and_weights_of_the_user_come_before_the_fit():
    lit = inputs(light(grey, 64), matte(0.5, 0.5, 0.5), glossy(0.1))
    given = miller1984(lit, k_d=(1, 2, 3), k_s=4.0, n=9.0, w_d=[0.5, 0.5], w_s=[[1, 2, 3], [1, 2, 3]], varnish=True)
    assert np.array_equal(given.material.k_d, [1, 2, 3])
    assert given.material.n == given.fit.n == 9
    head_on = radiance(given, np.array([[0, 0, 1.0]]), np.array([[0, 0, 1.0]]))[0]
    expected = 2 * (0.5 * np.array([1, 2, 3]) / 4 + np.array([1, 2, 3]) * (4 / 20 + 0.5))
    assert np.allclose(head_on, expected, rtol=2e-3)
    assert miller1984(lit, n=np.inf).material.mirror == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"diffuse": "phong"}, "option diffuse: unknown diffuse 'phong'. There are: lambert, self-luminous"),
        ({"lookup": "cubic"}, "option lookup: unknown lookup 'cubic'"),
        ({"n": 0.0}, "option n: 0.0 is no n. Give a number above 0"),
        ({"n": 1e6}, "option n: 1e+06 is more than"),
        ({"k_d": (1, 2)}, "option k_d: "),
        ({"k_s": -1.0}, "option k_s: "),
        ({"w_d": [1.0]}, "option w_d: "),
        ({"w_s": [[1.0, np.nan, 0.0]] * 2}, "option w_s: "),
        ({"specular_rows": 0}, "option specular_rows: "),
        ({"points": 0}, "option points: "),
        ({"illumination_rows": 1.5}, "option illumination_rows: "),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_line(options, message):
    with pytest.raises(InputError) as caught:
        method_of(inputs(light(grey, 16), matte(1, 1, 1)), **options)
    assert str(caught.value).startswith(message)


@pytest.mark.slow
@pytest.mark.parametrize(("material", "most"), [("rough-aluminium", 0.6), ("clearcoat-red", 0.6)])
def test_it_comes_near_the_truth_of_a_bake(small_bakes, references, material, most):
    """Path-traced maps: a wrong orientation, constant or unit would be off by more than the radiance itself."""
    method = MethodSet(small_bakes(material))["miller1984"]
    errors = []
    for frame, covered, truth, _ in references(material):
        found = image(method, frame, len(covered))[covered]
        errors.append(((found - truth) ** 2 / (truth**2 + (0.1 * truth.mean(axis=0)) ** 2)).mean())
        assert found.sum() == pytest.approx(truth.sum(), rel=0.15)
    assert np.sqrt(np.mean(errors)) < most
    assert method.cost.device_bytes > 0

"""The method against closed forms, and against the path tracer."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light
from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.split_sum.dfg import dfg
from rsibr.methods.split_sum.material_fit import nearest_alpha
from rsibr.methods.split_sum.split_sum import split_sum
from tests import lobe_shapes, microfacet
from tests.arrays import unit_vectors
from tests.methods.split_sum.lights import lamps, light_of

GREY = np.array([[0.5, 1.0, 2.0]])
HALF = np.full((len(node_cosines()), 3), 0.5)
AXES = ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1])


def made(light, *lobes, **options):
    """The method of a light and of lobes (shape, albedo)."""
    return split_sum(SimpleNamespace(light=light, shapes={f"lobe {k}": one for k, one in enumerate(lobes)}), **options)


def pairs(rng, count=300):
    """Normals and views at angles up to 85°."""
    n, v = unit_vectors(rng, 4 * count), unit_vectors(rng, 4 * count)
    v *= np.sign((n * v).sum(axis=1))[:, None]
    seen = np.flatnonzero((n * v).sum(axis=1) > 0.09)[:count]
    return n[seen], v[seen]


def evaluated(method, n, v):
    return np.array(method.eval(mi.Vector3f(n.T.astype(np.float32)), mi.Vector3f(v.T.astype(np.float32)))).T


@pytest.mark.parametrize("chain", [False, True])
def test_a_constant_sky_gives_the_albedo(chain, rng):
    f0, f90 = np.array([0.9, 0.5, 0.04]), np.array([1.0, 0.8, 1.0])
    cosines = node_cosines()
    glossy = dfg(cosines, np.array([0.3]))[0] @ np.stack([f0, f90])
    method = made(
        light_of(lambda _: GREY), (lobe_shapes.ggx(0.3), glossy), (lobe_shapes.matte(), HALF), chain=chain, size=48
    )
    n, v = pairs(rng)
    cosine = (n * v).sum(axis=1)
    expected = GREY * (0.5 + dfg(cosine, np.array([0.3]))[0] @ np.stack([f0, f90]))
    np.testing.assert_allclose(evaluated(method, n, v), expected, rtol=4e-3)
    assert method.fit_error < 0.02


def test_the_exact_albedo_is_the_lobes_own(rng):
    wavy = (0.5 + 0.3 * np.sin(9 * node_cosines()))[:, None] * np.ones(3)
    method = made(light_of(lambda _: GREY), (lobe_shapes.ggx(0.1), wavy), albedo="exact")
    n, v = pairs(rng)
    cosine = (n * v).sum(axis=1)
    np.testing.assert_allclose(evaluated(method, n, v), GREY * (0.5 + 0.3 * np.sin(9 * cosine))[:, None], rtol=1e-2)
    assert method.fit_error > 0.1


def test_a_white_lobe_reflects_everything_with_multiple_scattering(rng):
    shape = lobe_shapes.ggx(0.8)
    once = dfg(node_cosines(), np.array([nearest_alpha(shape)[0]]))[0].sum(axis=1)
    n, v = pairs(rng)
    lobe = shape, np.repeat(once[:, None], 3, axis=1)
    sky = light_of(lambda _: GREY)
    np.testing.assert_allclose(evaluated(made(sky, lobe, multiscatter=True), n, v), GREY + 0 * n, rtol=0.02)
    assert (evaluated(made(sky, lobe), n, v) < 0.9 * GREY).all()


def test_a_mirror_shows_the_environment(rng):
    smooth = lambda d: 1 + 0.4 * np.sin(2 * d + [0.1, 0.5, 0.9])  # noqa: E731
    n, v = pairs(rng)
    found = evaluated(made(light_of(smooth), (LobeShape.mirror(), 2 * HALF)), n, v)
    mirrored = 2 * (n * v).sum(axis=1)[:, None] * n - v
    np.testing.assert_allclose(found, smooth(mirrored), rtol=5e-3)


def test_a_matte_surface_under_a_gradient(rng):
    a = np.array([0.3, 0.6, -0.2])
    n, v = pairs(rng)
    found = evaluated(made(light_of(lambda d: 1 + np.repeat(d @ a[:, None], 3, 1)), (lobe_shapes.matte(), HALF)), n, v)
    np.testing.assert_allclose(found, 0.5 * (1 + 2 / 3 * np.repeat(n @ a[:, None], 3, 1)), rtol=3e-3)


def test_delta_lights_are_reflected_in_closed_form(rng):
    toward = np.array([0.6, 0.0, 0.8])
    delta = DeltaLights(toward[None].astype(np.float32), np.array([[3.0, 2.0, 1.0]], np.float32))
    black = Light(np.zeros((32, 32, 3), np.float32), delta=delta)
    fresnel = dfg(node_cosines(), np.array([0.3]))[0] @ np.array([[0.04] * 3, [1.0] * 3])
    method = made(black, (lobe_shapes.ggx(0.3), fresnel), (lobe_shapes.matte(), HALF), (LobeShape.mirror(), HALF))
    alpha = method.fits[0].alpha
    v = unit_vectors(rng, 200) * [1, 1, 0.5]
    v[:, 2] = np.abs(v[:, 2]) + 0.1
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    n = np.broadcast_to([0.0, 0.0, 1.0], v.shape)
    wi = np.broadcast_to(toward, v.shape)
    wanted = microfacet.dielectric(wi, v, alpha) + 0.5 * 0.8 / np.pi
    np.testing.assert_allclose(evaluated(method, n, v), wanted[:, None] * [3.0, 2.0, 1.0], rtol=0.02)
    below = evaluated(method, np.broadcast_to([0.0, 0.0, -1.0], v.shape), -v)
    assert not below.any()


def test_a_new_view_compiles_nothing():
    delta = DeltaLights(np.array([[0, 0, 1]], np.float32), np.ones((1, 3), np.float32))
    light = light_of(lamps)
    method = made(
        Light(light.picture, delta=delta),
        (lobe_shapes.ggx(0.2), HALF),
        (lobe_shapes.matte(), HALF),
        chain=True,
        size=32,
    )
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        for view in AXES[:3]:
            dr.eval(method.map(view_frame(view), 32))
            if view == AXES[0]:
                dr.kernel_history_clear()
        assert all(one["cache_hit"] for one in dr.kernel_history([dr.KernelType.JIT]))


@pytest.mark.parametrize(
    ("option", "value"), [("albedo", "exakt"), ("multiscatter", 1), ("chain", "yes"), ("size", 2.5), ("size", 4096)]
)
def test_an_option_that_makes_no_sense_is_refused_in_one_line(option, value):
    with pytest.raises(InputError, match=f"option {option}: .*{value}") as refused:
        made(light_of(lambda _: GREY), (lobe_shapes.ggx(0.1), HALF), **{option: value})
    assert "\n" not in str(refused.value)


def test_small_cubes_and_chains_are_made(rng):
    n, v = pairs(rng, 20)
    for options in ({"size": 4}, {"size": 4, "chain": True}, {"size": 20, "chain": True}):
        method = made(light_of(lambda _: GREY), (lobe_shapes.ggx(0.3), HALF), albedo="exact", **options)
        np.testing.assert_allclose(evaluated(method, n, v), 0.5 * GREY + 0 * n, rtol=5e-3)

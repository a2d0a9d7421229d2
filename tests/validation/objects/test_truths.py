"""Truths of objects against closed forms, and against the reference of sphere maps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh

from rsibr.geometry.frame import view_frame
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.validation.metrics import relative_mse_of_samples
from rsibr.validation.reference import render_reference
from tests.validation.doubles import GREY_SKY, Sky, slanted_sky
from tests.validation.objects.doubles import GLOSSY, LAMBERT, Coat, bowl, mesh, square, truths_of

GREY = np.array([1.0, 2.0, 0.5])
ALBEDO = np.array([0.8, 0.5, 0.2])


def sphere():
    return {"sphere": mi.load_dict({"type": "sphere"})}


def difference(a, b, pixels):
    return relative_mse_of_samples(*(one.buffers[:, pixels].astype(np.float64) for one in (a, b)))


def of_mean(reference, pixels):
    """Mean over pixels, and its standard error from the buffers."""
    means = reference.buffers[:, pixels].astype(np.float64).mean(axis=1)
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(means))


def assert_mean(reference, pixels, expected, relative=2e-3):
    """Whole means within 5 standard errors and a bias of `relative` (false alarms below 1e-3 at 7 degrees)."""
    mean, error = of_mean(reference, pixels)
    assert (np.abs(mean - expected) < 7 * error + relative * np.abs(expected)).all(), (mean, error, expected)


def test_open_shading_of_a_sphere_is_the_map_of_the_sphere():
    """From far away a camera sees a sphere as a sphere map does: the reference of maps is the other code."""
    view, n, distance = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8]), 24, 300.0
    frame = view_frame(view)
    camera = Camera.look_at(
        distance * view, (0, 0, 0), frame[:, 1], fov_deg=2 * np.degrees(np.arctan(1 / distance)), width=n, height=n
    )
    ours = truths_of(sphere(), camera, GLOSSY, slanted_sky(), samples=2048, rays=16).open()
    theirs = render_reference(slanted_sky(), GLOSSY, frame, n, 2048)
    centre = (np.arange(n) + 0.5) * 2 / n - 1
    found = difference(ours, theirs, np.hypot(*np.meshgrid(centre, centre)) < 0.9)
    low, high = found.ci95
    assert low < 2e-6, found  # places in a pixel differ: 2e-6 is what that makes of the highlights
    assert high < 2e-4, found


def test_all_truths_agree_on_a_convex_object():
    capsule = trimesh.creation.capsule(height=1.2, radius=0.7, count=(48, 48))
    shapes = {"capsule": mesh("capsule", capsule.vertices, capsule.faces, capsule.vertex_normals)}
    camera = Camera.look_at((1.2, 1.5, 4.6), (0, 0, 0.6), width=32, height=32)
    truths = truths_of(shapes, camera, GLOSSY, slanted_sky(), samples=512)
    opened, shadowed, full = truths.open(), truths.shadowed(), truths.full()
    plain = (truths.primary.coverage > 0) & (truths.primary.bent == 0)
    for a, b in ((opened, shadowed), (shadowed, full)):
        found = difference(a, b, plain)
        assert found.ci95[0] < 1e-5, found
        assert found.ci95[1] < 1e-3, found


@pytest.mark.parametrize("rays", [1, 3, 16])
def test_lambert_under_a_constant_sky_has_its_closed_form(rays):
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=16, height=12)
    truths = truths_of(sphere(), camera, LAMBERT, GREY_SKY, samples=128, rays=rays)
    for truth in (truths.open(), truths.open_all_over()):
        assert truth.buffers.shape == (8, 12, 16, 3)
        assert (truth.buffers[:, truths.primary.coverage == 0] == 0).all()
        assert truth.samples >= 128
    assert_mean(truths.open(), truths.primary.coverage > 0, ALBEDO * GREY)


def test_all_places_of_a_pixel_count_alike_where_samples_are_no_multiple_of_them():
    """With 3 places and a pass of 16 samples, one place has 6 of them; an edge would be seen too often."""
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=12, height=12)
    truths = truths_of(sphere(), camera, LAMBERT, Sky({"type": "directional", "direction": [0, 0, -1]}), 128, 3)
    assert truths.samples_of_buffer % 3 != 0
    found = truths.open().buffers
    assert np.ptp(found, axis=0).max() < 1e-5  # a delta light on Lambert has no noise: only the weights count
    expected = truths_of(sphere(), camera, LAMBERT, Sky({"type": "directional", "direction": [0, 0, -1]}), 72, 3)
    assert expected.samples_of_buffer == 9
    np.testing.assert_allclose(found[0], expected.open().buffers[0], atol=1e-5)


def test_a_mirror_reflects_the_sky_exactly():
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), fov_deg=20, width=16, height=16)
    truths = truths_of(sphere(), camera, Coat({"type": "conductor", "material": "none"}), slanted_sky(), 64, rays=1)
    layers, covered = truths.primary.layers, truths.primary.coverage > 0
    n = layers.normal[covered].astype(np.float64)
    points = n  # of the unit sphere
    v = np.array([0, 0, 4]) - points
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    mirrored = 2 * (n * v).sum(axis=1, keepdims=True) * n - v
    np.testing.assert_allclose(truths.open().mean[covered], 1 + mirrored / 2, atol=2e-3)


def test_a_directional_light_on_lambert_has_its_closed_form():
    sun = Sky({"type": "directional", "direction": [0, -0.6, -0.8], "irradiance": {"type": "rgb", "value": 2.0}})
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=16, height=16)
    truths = truths_of(sphere(), camera, LAMBERT, sun, 64, rays=1)
    covered = truths.primary.coverage > 0
    cosine = np.maximum(truths.primary.layers.normal[covered] @ np.array([0, 0.6, 0.8]), 0)
    np.testing.assert_allclose(truths.open().mean[covered], cosine[:, None] * ALBEDO * 2 / np.pi, atol=1e-4)
    np.testing.assert_allclose(truths.shadowed().mean[covered], cosine[:, None] * ALBEDO * 2 / np.pi, atol=1e-4)


def test_shadows_and_bounces_of_a_bowl_have_their_closed_forms():
    """Each point of a hemisphere's inside sees the sky by half, and the bowl, which is equally bright, by half."""
    camera = Camera.look_at((0.0, 3.0, 0.01), (0, -0.5, 0), fov_deg=25, width=12, height=12)
    truths = truths_of({"bowl": bowl()}, camera, LAMBERT, GREY_SKY, samples=1024)
    inside = truths.primary.coverage == 1
    assert inside.sum() > 50
    assert_mean(truths.open(), inside, ALBEDO * GREY)
    assert_mean(truths.shadowed(), inside, ALBEDO * GREY / 2, 5e-3)
    assert_mean(truths.full(), inside, ALBEDO * GREY / 2 / (1 - ALBEDO / 2), 1e-2)


def test_one_map_is_exact_for_its_own_view_and_for_matte_surfaces_by_normal():
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), fov_deg=40, width=24, height=24)
    far = Camera.look_at((0, 0, 400), (0, 0, 0), fov_deg=0.35, width=24, height=24)
    apart = {}
    for name, at, coat in (("glossy", camera, GLOSSY), ("far", far, GLOSSY), ("matte", camera, LAMBERT)):
        truths = truths_of(sphere(), at, coat, slanted_sky(), samples=512)
        inner = (truths.primary.coverage == 1) & (truths.primary.layers.normal[..., 2] > 0.5)
        apart[name] = difference(truths.one_map(), truths.open(), inner)
    assert apart["glossy"].ci95[0] > 1e-4, apart
    assert apart["far"].ci95[0] < 1e-5, apart
    assert apart["matte"].ci95[0] < 1e-5, apart


def test_one_map_by_reflection_is_exact_for_a_mirror_in_any_perspective():
    camera = Camera.look_at((0, 0, 2), (0, 0, 0), fov_deg=70, width=16, height=16)
    truths = truths_of(sphere(), camera, Coat({"type": "conductor", "material": "none"}), slanted_sky(), 64, rays=1)
    inner = (truths.primary.coverage == 1) & (truths.primary.layers.normal[..., 2] > 0.6)  # but for its rim
    np.testing.assert_allclose(truths.one_map().mean[inner], truths.open().mean[inner], atol=2e-3)


def test_what_has_no_bake_hides_but_is_not_judged():
    shapes = {"floor": square("floor", (-2, 0, 2), (4, 0, 0), (0, 0, -4)), "ball": mi.load_dict({"type": "sphere"})}
    camera = Camera.look_at((0, 3, 6), (0, 0, 0), width=24, height=24)
    truths = truths_of(shapes, camera, LAMBERT, GREY_SKY, 64)
    both = truths.primary.coverage
    scene = truths.primary.scene
    alone = replace(truths, primary=type(truths.primary)(scene, SurfaceTypes.assign(scene, ["ball"]), camera, 4))
    ball = alone.primary.coverage
    assert 0 < (ball > 0).sum() < (both > 0).sum()
    assert (alone.shadowed().buffers[:, ball == 0] == 0).all()


def test_each_shape_has_the_material_of_its_type():
    shapes = {x: mi.load_dict({"type": "sphere", "center": [c, 0, 0]}) for x, c in (("left", -9.0), ("right", 9.0))}
    camera = Camera.look_at((0, 0, 30), (0, 0, 0), width=32, height=8)
    one = truths_of(shapes, camera, LAMBERT, GREY_SKY, 128)
    grey = Coat({"type": "diffuse", "reflectance": 0.25}, "normal")
    two = replace(
        one,
        primary=replace(one.primary, types=SurfaceTypes.assign(one.primary.scene, ["right", "left"])),
        bakes=dict.fromkeys(("right", "left"), one.bakes["*"]),
        prepared=[SimpleNamespace(environment=GREY_SKY, material=coat) for coat in (LAMBERT, grey)],
    )
    covered, left = two.primary.coverage > 0, np.arange(32) < 16
    for truth in (two.open(), two.shadowed(), two.one_map()):
        assert_mean(truth, covered & left, 0.25 * GREY, 0.02)  # light from the other sphere: below 2 %
        assert_mean(truth, covered & ~left, ALBEDO * GREY, 0.02)


def test_pixels_with_a_normal_without_direction_are_not_judged():
    quad = square("quad", (-1, -1, 0), (2, 0, 0), (0, 2, 0))
    broken = mesh(
        "broken", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]], np.full((4, 3), np.nan)
    )
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=8, height=8)
    assert truths_of({"q": quad}, camera, LAMBERT, GREY_SKY, 64).primary.pixels.size > 0
    assert truths_of({"b": broken}, camera, LAMBERT, GREY_SKY, 64).primary.pixels.size == 0


def test_other_seeds_give_other_numbers_and_the_same_seed_the_same():
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=8, height=8)
    one, again, other = (truths_of(sphere(), camera, GLOSSY, slanted_sky(), 64, seed=s).open() for s in (1, 1, 2))
    np.testing.assert_array_equal(one.buffers, again.buffers)
    assert (one.buffers != other.buffers).any()
    assert len({buffer.tobytes() for buffer in one.buffers}) == 8


def test_smooth_plastic_has_both_its_delta_and_its_matte_part():
    """Under a constant sky its albedo is that of the furnace: the same BSDF, integrated over directions by itself."""
    plastic = Coat({"type": "plastic", "diffuse_reflectance": {"type": "rgb", "value": [0.8, 0.5, 0.2]}})
    camera = Camera.look_at((0, 0, 40), (0, 0, 0), fov_deg=0.5, width=4, height=4)  # the middle: v along the normal
    truths = truths_of(sphere(), camera, plastic, GREY_SKY, 4096, rays=1)
    bsdf, count = plastic.bsdf(), 2**18
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f(0, 0, 1)
    rng = mi.PCG32(size=count)
    context = mi.BSDFContext()
    _, weight = bsdf.sample(context, si, rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32()))
    albedo = np.array(weight).mean(axis=1)
    assert_mean(truths.open(), truths.primary.coverage > 0, albedo * GREY, 5e-3)
    assert albedo[2] > 0.04  # the mirror part of a dark channel

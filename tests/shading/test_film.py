import gc

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.shading import film
from rsibr.shading.lookups.registry import lookup_named
from rsibr.shading.surface_types import SurfaceTypes
from tests.shading.analytic import ball_scene, centres, constant, directions, framing, on_ball, pictured, slanted


def test_alpha_is_the_area_of_the_outline():
    """The outline of a ball on the axis is a circle; its area in each pixel is known."""
    camera = framing(32)
    exact = texel_coverage(32)
    alpha = pictured(constant(), camera, 64).alpha
    assert np.abs(alpha - exact).max() < 0.06
    assert alpha.mean() == pytest.approx(exact.mean(), abs=5e-4)
    assert set(np.unique(alpha * 64) % 1) == {0.0}


def test_radiance_is_premultiplied():
    picture = pictured(constant(), framing(16), 4)
    assert np.allclose(picture.radiance, picture.alpha[..., None] * [0.25, 0.5, 1.0], atol=1e-6)


def test_one_ray_is_the_middle_of_the_pixel():
    camera = framing(24, width=24, height=16)
    picture = pictured(slanted(), camera, 1)
    distance, n = on_ball(camera, directions(camera, *centres(camera)))
    hit = np.isfinite(distance)
    assert np.array_equal(picture.alpha, hit.astype(np.float32))
    assert np.allclose(picture.depth[hit], distance[hit], atol=1e-4)
    assert np.isinf(picture.depth[~hit]).all()
    assert np.allclose(picture.normal[hit], n[hit], atol=1e-3)
    assert not picture.normal[~hit].any()
    assert np.allclose(picture.radiance[hit], 1 + 0.5 * n[hit], atol=1e-3)
    assert not picture.radiance[~hit].any()


def test_many_rays_are_the_mean_over_the_square():
    """Radiance linear in the normal, against a dense mean of closed-form hits."""
    camera = framing(8)
    picture = pictured(slanted(), camera, 256)
    fine = (np.arange(8 * 40) + 0.5) / 40
    distance, n = on_ball(camera, directions(camera, *np.meshgrid(fine, fine)))
    shown = np.where(np.isfinite(distance)[..., None], 1 + 0.5 * n, 0)
    exact = shown.reshape(8, 40, 8, 40, 3).mean(axis=(1, 3))
    assert np.abs(picture.radiance - exact).max() < 0.02
    assert np.abs(picture.radiance - exact)[2:6, 2:6].max() < 1e-3


def test_parts_of_a_picture_are_the_whole(monkeypatch):
    camera = framing(20)
    whole = pictured(slanted(), camera, 4)
    monkeypatch.setattr(film, "PIXELS_PER_LAUNCH", 70)
    parts = pictured(slanted(), camera, 4)
    for name in ("radiance", "alpha", "depth", "normal"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))
    assert vars(whole.counts) == vars(parts.counts)
    assert whole.counts.hits == round(whole.alpha.sum() * 4)


def test_a_shape_without_a_bake_hides_and_is_not_shown():
    small = backend.load({"type": "sphere", "radius": 0.3, "center": [0, 0, 2]})
    scene = ball_scene(front=small)
    types = SurfaceTypes.assign(scene, ["ball"])
    camera = framing(16)
    shade = lookup_named("pixel").make(constant(), scene).toward(camera)
    alpha = film.developed(scene, camera, types, [shade], 4).alpha
    assert alpha[7:9, 7:9].max() == 0
    assert alpha[8, 2] == 1


def test_each_type_has_its_own_radiance():
    other = backend.load({"type": "sphere", "radius": 0.3, "center": [0, 0, 2]})
    scene = ball_scene(front=other)
    types, camera = SurfaceTypes.assign(scene, ["ball", "front"]), framing(16)
    shades = [lookup_named("pixel").make(one, scene).toward(camera) for one in (constant(), slanted())]
    radiance = film.developed(scene, camera, types, shades, 1).radiance
    assert np.allclose(radiance[8, 2], [0.25, 0.5, 1.0])
    assert np.allclose(radiance[7:9, 7:9].mean(axis=(0, 1)), [1, 1, 1.5], atol=0.02)


@pytest.mark.slow
def test_full_hd_with_sixteen_rays_stays_in_bounded_memory():
    """State of a pixel, not of a ray: 2 Mpixel × 16 rays of 30 floats would be 4 GB."""

    def peak() -> int:
        return dr.detail.malloc_watermark(dr.backend_v(mi.Float))

    # What earlier tests hold, and what the allocator keeps for reuse, is no part of this picture.
    gc.collect()
    dr.flush_malloc_cache()
    dr.detail.malloc_clear_statistics()
    before = peak()
    picture = pictured(constant(), framing(64, width=1920, height=1080), 16, "map-reflection", filter="mip")
    assert picture.radiance.shape == (1080, 1920, 3)
    assert 0 < peak() - before < 0.5e9

"""Lookups in reconstructed maps, in whole pictures of a ball."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.lookups.registry import lookup_named, lookups
from tests.shading.analytic import Method, ball_scene, constant, framing, mirror, pictured, slanted, sun

WAYS = ("map-normal", "map-reflection", "map-grid")
FILTERS = ("none", "mip", "subdivision", "quadrilateral", "sat")
WIDE = Camera.look_at((0, 0, 1.6), (0, 0, 0), fov_deg=80, width=24, height=24)


def sky():
    return mirror(lambda d: mi.Color3f(1.5 + d.x, 1.5 + 0.5 * d.y + 0.5 * d.x * d.z, 2 + d.y * d.z))


def relative(picture, truth, least_alpha=0.999):
    inside = truth.alpha > least_alpha
    difference = picture.radiance[inside] - truth.radiance[inside]
    return (difference**2).mean() / (truth.radiance[inside] ** 2).mean()


@pytest.mark.parametrize("used", FILTERS)
@pytest.mark.parametrize("way", WAYS)
def test_a_constant_radiance_is_a_constant_picture(way, used):
    picture = pictured(constant(), WIDE, 2, way, filter=used, resolution=32)
    assert np.allclose(picture.radiance, picture.alpha[..., None] * [0.25, 0.5, 1.0], rtol=1e-4, atol=1e-6)


def test_a_matte_ball_needs_the_normal_and_a_mirror_the_reflection():
    """Perspective: what depends on the normal alone is exact by the normal, a mirror by the reflection."""
    matte, shiny = (pictured(one, WIDE, 4) for one in (slanted(), sky()))
    options = {"camera": WIDE, "rays": 4, "resolution": 256}
    assert relative(pictured(slanted(), lookup="map-normal", **options), matte) < 2e-5
    assert relative(pictured(sky(), lookup="map-reflection", **options), shiny) < 2e-5
    assert relative(pictured(slanted(), lookup="map-reflection", **options), matte) > 1e-3
    assert relative(pictured(sky(), lookup="map-normal", **options), shiny) > 1e-2


@pytest.mark.parametrize("index", ["reflection", "normal"])
def test_a_finer_grid_of_views_is_closer(index):
    """A gloss whose brightness depends on the angle to the viewer, which no map of another view has."""
    gloss = Method(lambda n, v: mi.Color3f(1 + (2 * dr.dot(n, v) * n - v).x) * (2 - dr.dot(n, v)))
    truth = pictured(gloss, WIDE, 4)
    errors = [
        relative(pictured(gloss, WIDE, 4, "map-grid", grid=grid, index=index, resolution=128), truth)
        for grid in (2, 4, 8)
    ]
    assert errors[0] > 3 * errors[1] > 3 * errors[2] * 1.5
    assert errors[2] < 1e-4


def test_the_middle_of_a_picture_has_no_perspective():
    camera = framing(33, fov_deg=4)
    truth = pictured(sky(), camera, 1)
    for way in WAYS:
        shown = pictured(sky(), camera, 1, way)
        assert np.allclose(shown.radiance[16, 16], truth.radiance[16, 16], rtol=5e-3)


def test_filters_keep_the_energy_of_a_sun_that_points_miss():
    """One ray a pixel of a small mirror ball under a sun of 1e6 next to darkness, against 4096 rays."""
    camera = framing(16)
    method = sun()
    energy = pictured(method, camera, 4096).radiance.sum()
    kept = {
        used: pictured(method, camera, 1, "map-reflection", filter=used, resolution=512).radiance.sum() / energy
        for used in FILTERS
    }
    assert not 0.5 < kept["none"] < 2
    for used in ("subdivision", "quadrilateral", "sat"):
        assert kept[used] == pytest.approx(1, abs=0.1), kept
    assert kept["mip"] == pytest.approx(1, abs=0.6), kept


def test_filters_beat_points_on_a_fine_pattern():
    stripes = mirror(lambda d: mi.Color3f(1 + 0.9 * dr.sin(60 * d.x)))
    camera = framing(16)
    truth = pictured(stripes, camera, 1024)
    errors = {
        used: relative(pictured(stripes, camera, 1, "map-reflection", filter=used, resolution=512), truth)
        for used in FILTERS
    }
    for used in FILTERS[1:]:
        assert errors[used] < 0.35 * errors["none"], errors


@pytest.mark.parametrize("way", ["pixel", *WAYS])
def test_a_turned_camera_and_other_numbers_of_rays_compile_nothing(way):
    scene, method = ball_scene(), sky()
    for used in FILTERS if way == "map-reflection" else FILTERS[:1]:
        options = {} if way == "pixel" else {"filter": used, "resolution": 32}
        lookup, rays = lookup_named(way).make(method, scene, **options), (1, 4, 5)
        from rsibr.shading.film import developed
        from rsibr.shading.surface_types import SurfaceTypes

        types = SurfaceTypes.assign(scene, ["*"])
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            for k, count in enumerate(rays):
                dr.kernel_history_clear()
                camera = Camera.look_at((k, 1, 5), (0, 0.1 * k, 0), fov_deg=30 + k, width=16, height=16)
                shade = lookup.toward(camera)
                developed(scene, camera, types, [shade], count, has_footprints=lookup.needs_footprint)
                launched = [one for one in dr.kernel_history() if one["type"] == dr.KernelType.JIT]
                assert launched
                assert k < 1 or all(one["cache_hit"] for one in launched), (way, used, k)


def test_wrong_options_are_one_line():
    scene = ball_scene()
    assert {"pixel", *WAYS} <= set(lookups())
    assert lookup_named("map-reflection").options == {"filter": "none", "resolution": 256}
    with pytest.raises(InputError, match="There are: filter, resolution"):
        lookup_named("map-reflection").checked({"filtre": "mip"})
    with pytest.raises(InputError, match="unknown lookup"):
        lookup_named("map-refraction")
    for options in ({"grid": 1}, {"index": "view"}, {"filter": "box"}, {"resolution": 100}):
        with pytest.raises(InputError):
            lookup_named("map-grid").make(constant(), scene, **options)

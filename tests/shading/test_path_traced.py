"""Surfaces without a bake, path-traced: closed forms under simple light, and pixels shared without a seam."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.baking.baker import bake
from rsibr.scene.config import parse_config
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.path_traced import path_traced_rest, unbaked_refusal
from rsibr.shading.renderer import ObjectRenderer
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import first_surfaces
from rsibr.store.bake import open_bake

SIZE, RADIANCE, ALBEDO = 24, 0.5, 0.5
CAMERA = Camera.look_at((0, 0, 6), (0, 0, 0), fov_deg=40, width=SIZE, height=SIZE)
LEFT, RIGHT = [-0.9, 0, 0], [0.9, 0, 0]


def baked_under(folder, environment, material):
    config = {
        "environment": environment,
        "material": material,
        "map": {"resolution": 8},
        "sampling": {"samples": 4},
        "effects": {"view_dependence": "on"},
    }
    return {"left": open_bake(bake(parse_config(config, folder), out=folder / "b.rsibr").path)}


@pytest.fixture(scope="module")
def even(tmp_path_factory):
    """Bake of a matte material under constant light."""
    folder = tmp_path_factory.mktemp("even")
    plugin = {"type": "diffuse", "reflectance": ALBEDO}
    return baked_under(folder, {"emitter": {"type": "constant", "radiance": RADIANCE}}, {"bsdf": plugin})


def pair(**of_right):
    """Two spheres, or another shape on the right."""
    right = {"type": "sphere", "center": RIGHT, "radius": 0.7, **of_right}
    left = {"type": "sphere", "center": LEFT, "radius": 0.7}
    with backend.session():
        return ObjectScene("two", {"left": backend.load(left), "right": backend.load(right)})


def traced(scene, bakes, rays=4, seed=1, samples=64):
    return path_traced_rest(scene, SurfaceTypes.assign(scene, list(bakes)), bakes, CAMERA, rays, seed, samples)


def test_a_matte_sphere_under_a_linear_sky(tmp_path, gradient_sky, gradient_axis):
    bakes = baked_under(tmp_path, {"file": str(gradient_sky)}, {"preset": "matte-lambert"})
    alone = pair(bsdf={"type": "diffuse", "reflectance": ALBEDO})
    bakes = {"left": bakes["left"]}
    alone.shapes["left"] = backend.load({"type": "sphere", "center": [-50, 0, 0]})
    radiance, alpha = traced(alone, bakes, rays=1, samples=1024)
    camera = CAMERA.on_device()
    at = first_surfaces(alone.geometry, camera.ray(camera.centre(mi.UInt32(np.arange(SIZE**2)))))
    wanted = ALBEDO * (1 + 2 / 3 * gradient_axis @ np.array(at.n)).reshape(SIZE, SIZE)  # ∫ (1 + a·ω) cos / π
    inside = alpha == 1
    assert inside.sum() > 20
    np.testing.assert_allclose(radiance[inside], np.repeat(wanted[inside][:, None], 3, 1), rtol=0.05)
    assert not radiance[alpha == 0].any()


@pytest.mark.parametrize("glass", ["dielectric", "thindielectric"])
def test_glass_shows_an_even_environment_through_it(even, glass):
    radiance, alpha = traced(pair(bsdf={"type": glass}), even, samples=256)
    middle = alpha == 1
    assert middle.sum() > 20
    outer = radiance[middle] / RADIANCE  # what reaches the baked sphere by a detour comes back darker
    assert np.median(outer) == pytest.approx(1, abs=0.03)
    assert outer.max() <= 1.02  # Russian roulette of long paths inside the glass is noise


def test_a_baked_shape_behind_an_invisible_pane_has_its_material(even):
    look = mi.ScalarTransform4f().translate([-0.6, 0, 2]).scale(0.15)
    pane = {"type": "thindielectric", "int_ior": 1.0, "ext_ior": 1.0}
    with backend.session():
        shapes = {"left": {"type": "sphere", "center": LEFT, "radius": 0.7}}
        shapes["pane"] = {"type": "rectangle", "to_world": look, "bsdf": pane}
        scene = ObjectScene("pane", {name: backend.load(shape) for name, shape in shapes.items()})
    radiance, alpha = traced(scene, even, samples=1024)
    assert (alpha == 1).any()
    assert radiance[alpha == 1].mean() == pytest.approx(ALBEDO * RADIANCE, rel=0.02)


def test_both_parts_of_a_picture_share_each_pixel(even):
    scene = pair(center=[0.2, 0, 0.8])  # in front of the other
    rest = traced(scene, even, rays=16, samples=16)[1]
    baked = ObjectRenderer(scene, even, occlusion="off").picture(CAMERA, 16).alpha
    whole = ObjectRenderer(scene, {"*": even["left"]}, occlusion="off").picture(CAMERA, 16).alpha
    np.testing.assert_array_equal(baked + rest, whole)
    assert ((baked > 0) & (rest > 0)).any()


def test_equal_seeds_give_equal_bits(even):
    first, again, other = (traced(pair(), even, seed=seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_nothing_is_traced_where_every_shape_has_a_bake(even, monkeypatch):
    monkeypatch.setattr("rsibr.shading.path_traced.lit_scene", None)
    radiance, alpha = traced(pair(), {"*": even["left"]})
    assert not radiance.any()
    assert not alpha.any()


def test_a_refusal_names_the_shapes(even):
    scene = pair()
    said = str(unbaked_refusal(scene, SurfaceTypes.assign(scene, ["left"])))
    assert said == "two: no bake for 'right'. Give --bake right=BAKE, or leave out --strict to path-trace them"
    assert unbaked_refusal(scene, SurfaceTypes.assign(scene, ["*"])) is None

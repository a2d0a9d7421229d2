"""Scene that Mitsuba path-traces: materials and light of the bakes."""

from __future__ import annotations

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.errors import InputError
from rsibr.shading.scenes.lit_scene import lit_scene, require_one_light, two_sided
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes


def bake(light="sky", name="city"):
    identity = {"environment": {"content": light, "name": name}}
    return SimpleNamespace(manifest=SimpleNamespace(identity=identity), path=light)


def prepared(albedo):
    material = {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}
    return SimpleNamespace(
        material=SimpleNamespace(bsdf=lambda: backend.load(material)),
        environment=SimpleNamespace(emitter=lambda: {"type": "constant", "radiance": {"type": "rgb", "value": 2.0}}),
    )


def radiance(scene, origin, toward):
    ray = mi.RayDifferential3f(mi.Point3f(*origin), mi.Vector3f(*toward))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, 4096)
    ray.o += dr.zeros(mi.Point3f, 4096)
    integrator = mi.load_dict({"type": "path", "hide_emitters": True})
    return np.array(integrator.sample(scene, sampler, ray)[0]).mean(axis=-1)


@pytest.fixture
def shapes():
    def ball(x):
        return mi.load_dict({"type": "sphere", "center": [x, 0, 0], "bsdf": {"type": "diffuse", "reflectance": 0.25}})

    return {"left": ball(-30.0), "right": ball(30.0), "rest": ball(90.0)}


def test_each_shape_has_the_material_of_its_bake_and_the_rest_keep_theirs(shapes):
    scene = ObjectScene("balls", shapes)
    bakes = {"left": bake(), "right": bake()}
    types = SurfaceTypes.assign(scene, list(bakes))
    lit = lit_scene(scene, types, bakes, prepared=[prepared([0.8, 0.4, 0.2]), prepared([0.1, 0.5, 0.9])])
    for x, albedo in ((-30.0, [0.8, 0.4, 0.2]), (30.0, [0.1, 0.5, 0.9]), (90.0, [0.25, 0.25, 0.25])):
        np.testing.assert_allclose(radiance(lit, (x, 0, 5), (0, 0, -1)), 2 * np.array(albedo), rtol=0.05)
    np.testing.assert_array_equal(radiance(lit, (0, 0, 5), (0, 0, -1)), 0)


def test_faces_turned_inside_out_reflect_too(shapes):
    scene = ObjectScene("ball", {"ball": mi.load_dict({"type": "sphere", "flip_normals": True})})
    bakes = {"*": bake()}
    lit = lit_scene(scene, SurfaceTypes.assign(scene, ["*"]), bakes, prepared=[prepared([0.5, 0.5, 0.5])])
    np.testing.assert_allclose(radiance(lit, (0, 0, 5), (0, 0, -1)), 1.0, rtol=0.05)


def test_a_material_of_two_sides_is_kept():
    both = mi.load_dict({"type": "twosided", "inner": {"type": "diffuse"}})
    assert two_sided(both) is both
    assert mi.has_flag(two_sided(mi.load_dict({"type": "roughplastic"})).flags(), mi.BSDFFlags.BackSide)


def test_extra_entries_are_part_of_the_scene(shapes):
    scene, bakes = ObjectScene("balls", shapes), {"*": bake()}
    types = SurfaceTypes.assign(scene, ["*"])
    lit = lit_scene(scene, types, bakes, {"integrator": {"type": "direct"}}, [prepared([0.5] * 3)])
    assert "Direct" in str(lit.integrator())


def test_bakes_of_different_lights_are_refused_and_of_one_light_by_another_name_are_not():
    require_one_light({"a": bake(name="city"), "b": bake(name="copy of city")})
    with pytest.raises(InputError, match="'a' and 'b' were lit by different environments"):
        require_one_light({"a": bake("sky"), "b": bake("studio")})

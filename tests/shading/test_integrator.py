"""The Mitsuba integrator: radiance of bakes at primary hits, Mitsuba's own everywhere else, in the user's variant."""

from __future__ import annotations

import threading

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.methods.method_set import MethodSet
from rsibr.scene.config import parse_config
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.integrator import register_plugins
from rsibr.shading.renderer import ObjectRenderer
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import UNBAKED, SurfaceTypes
from rsibr.shading.surfaces import first_surfaces
from rsibr.store.bake import open_bake

SIZE, EYE = 32, (1.0, 1.0, 7.0)
METHOD = "cabral1999"


@pytest.fixture(autouse=True)
def _variant():
    """A user's RGB variant with the plugins; that of all other tests afterwards."""
    mi.set_variant(backend.use())
    register_plugins()
    yield
    backend.use()


@pytest.fixture(scope="module")
def paint(tmp_path_factory, asymmetric_environment):
    """Path of a small bake."""
    config = {
        "environment": {"file": str(asymmetric_environment)},
        "material": {"preset": "clearcoat-red"},
        "map": {"resolution": 24},
        "sampling": {"samples": 16},
    }
    folder = tmp_path_factory.mktemp("plugin")
    return str(bake(parse_config(config, folder), out=folder / "paint.rsibr").path)


def integrator(paint, **more):
    return {"type": "rsibr", "bake_ball": paint, "method": METHOD, "occlusion": "off", **more}


def scene(chosen, **more):
    """A ball, a red one beside it, and a lamp in front of the ball, under a light that no bake knows."""
    look = mi.ScalarTransform4f().look_at(list(EYE), [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "pixel_format": "rgba", "rfilter": {"type": "box"}}
    red = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.2, 0.1]}}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": chosen,
            "ball": {"type": "sphere", "bsdf": {"type": "diffuse"}},
            "red": {"type": "sphere", "center": [1.7, 0, 0], "radius": 0.6, "bsdf": red},
            "lamp": {"type": "sphere", "center": [0, 0, 3], "radius": 0.1, "emitter": {"type": "area"}},
            "light": {"type": "constant", "radiance": 0.7},
            "sensor": {"type": "perspective", "fov": 40, "to_world": look, "film": film},
            **more,
        }
    )


def rendered(made, spp=16):
    return np.array(mi.render(made, spp=spp, seed=3))


def rays():
    camera = Camera.look_at(EYE, (0, 0, 0), fov_deg=40, width=SIZE, height=SIZE).on_device()
    return camera.ray(camera.centre(dr.arange(mi.UInt32, SIZE**2)))


def sampler(size=SIZE**2):
    made = mi.load_dict({"type": "independent"})
    made.seed(0, size)
    return made


def test_primary_hits_have_exactly_the_radiance_of_the_method(paint):
    made, ray = scene(integrator(paint)), rays()
    found, valid, layers = made.integrator().sample(made, sampler(), mi.RayDifferential3f(ray))
    at = first_surfaces(made, ray)
    ball = next(shape for shape in made.shapes() if shape.id() == "ball")
    on_ball = np.array(at.shape) == np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(ball)))
    wanted = np.array(MethodSet(open_bake(paint))[METHOD].eval(at.n, at.v))
    assert on_ball.sum() > 100
    np.testing.assert_allclose(np.array(found)[:, on_ball], wanted[:, on_ball], rtol=1e-5)
    assert np.array(valid).all()
    assert layers == []


def test_everything_else_is_the_nested_integrators_to_the_bit(paint):
    ours, path = rendered(scene(integrator(paint))), rendered(scene({"type": "path"}))
    alone = ObjectRenderer(_ball(), {"*": open_bake(paint)}, METHOD, occlusion="off")
    covered = alone.picture(_camera(), 64).alpha > 0
    wide = covered | np.roll(covered, 1, 0) | np.roll(covered, -1, 0) | np.roll(covered, 1, 1) | np.roll(covered, -1, 1)
    np.testing.assert_allclose(ours[~wide], path[~wide], rtol=1e-5)
    assert np.abs(ours[covered] - path[covered]).max() > 0.1


def _alone(chosen, *, light):
    """A ball before `light`, and nothing else."""
    look = mi.ScalarTransform4f().look_at(list(EYE), [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "pixel_format": "rgba", "rfilter": {"type": "box"}}
    sensor = {"type": "perspective", "fov": 40, "to_world": look, "film": film}
    lights = {"light": light} if light else {}
    return mi.load_dict({"type": "scene", "integrator": chosen, "ball": {"type": "sphere"}, "sensor": sensor, **lights})


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_spectral", "llvm_ad_spectral_polarized"])
@pytest.mark.parametrize("hides", [False, True])
def test_what_is_seen_beside_baked_shapes_alone_is_the_path_tracers_to_the_bit(paint, variant, hides):
    """Then the nested integrator is not asked."""
    mi.set_variant(variant)
    colours = mi.Bitmap(np.random.default_rng(1).random((4, 8, 3)).astype(np.float32))
    for light in ({"type": "envmap", "bitmap": colours}, {"type": "point", "position": [0, 9, 9]}, None):
        ours, path, depth = (
            rendered(_alone(chosen, light=light))
            for chosen in (
                integrator(paint, hide_emitters=hides),
                {"type": "path", "hide_emitters": hides},
                {"type": "depth"},
            )
        )
        beside = depth[..., 3] == 0
        assert 100 < beside.sum() < SIZE**2 - 100
        assert np.array_equal(ours[beside], path[beside])
        assert np.all(ours[~beside, 3] > 0)


def test_a_picture_is_that_of_the_renderer(paint):
    made = scene(integrator(paint, hide_emitters=True))
    ours = rendered(made, 256)
    wanted = ObjectRenderer(_ball(), {"*": open_bake(paint)}, METHOD, occlusion="off").picture(_camera(), 256)
    inside = np.array(rendered(made, 16))[..., 3] == 1
    inside &= (wanted.alpha == 1) & (np.arange(SIZE) < 19)  # left of the red ball
    assert inside.sum() > 60
    np.testing.assert_allclose(ours[inside, :3].mean(0), wanted.radiance[inside].mean(0), rtol=0.02)
    np.testing.assert_allclose(ours[inside, :3], wanted.radiance[inside], rtol=0.1, atol=0.02)


def test_hidden_emitters_are_seen_through_and_the_background_is_transparent(paint):
    hidden = scene(integrator(paint, hide_emitters=True))
    toward_lamp = mi.RayDifferential3f(mi.Ray3f([0, 0, 6], [0, 0, -1]))
    found = hidden.integrator().sample(hidden, sampler(1), toward_lamp)[0]
    wanted = MethodSet(open_bake(paint))[METHOD].eval(mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0, 1))
    np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-4)
    assert rendered(hidden)[0, 0].tolist() == [0, 0, 0, 0]
    assert rendered(scene(integrator(paint)))[0, 0, 3] == 1


def test_a_filtered_map_takes_its_footprint_from_the_differentials(paint):
    """As the renderer's own corner rays do (`test_corner_rays.py`); the rays are at other places of the pixel."""
    lookup = "map-reflection,filter=mip,resolution=64"
    made = scene(integrator(paint, hide_emitters=True, lookup=lookup))
    ours = rendered(made, 64)
    wanted = ObjectRenderer(_ball(), {"*": open_bake(paint)}, METHOD, lookup, occlusion="off").picture(_camera(), 64)
    inside = (ours[..., 3] == 1) & (wanted.alpha == 1) & (np.arange(SIZE) < 19)
    assert inside.sum() > 60
    np.testing.assert_allclose(ours[inside, :3].mean(0), wanted.radiance[inside].mean(0), rtol=0.03)
    with pytest.raises(RuntimeError, match="differentials"):
        _sampled_without_differentials(made, made.integrator())


def _sampled_without_differentials(made, chosen):
    try:
        chosen._shades = chosen._shades_toward(made, made.sensors()[0])
        chosen.sample(made, sampler(), mi.RayDifferential3f(rays()))
    except InputError as error:
        raise RuntimeError(str(error)) from error
    finally:
        chosen._shades = None


@pytest.mark.parametrize(("lookup", "says"), [("map-reflection,filtr=mip", "filtr"), ("pixl", "pixel")])
def test_options_of_a_lookup_are_checked_when_the_scene_is_loaded(paint, lookup, says):
    with pytest.raises(Exception, match=says):
        scene(integrator(paint, lookup=lookup))


def test_a_mesh_that_is_moved_in_place_hides_the_sky_from_where_it_is(paint):
    def two_cubes(x):
        look = mi.ScalarTransform4f().look_at([1, 3, 6], [0, 0, 0], [0, 1, 0])
        film = {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}}
        moved = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([x, 0, 0])}
        chosen = {"type": "rsibr", "bake": paint, "method": METHOD, "occlusion": "on"}
        sensor = {"type": "perspective", "fov": 50, "to_world": look, "film": film}
        still = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([-1.1, 0, 0])}
        light = {"type": "constant"}
        return mi.load_dict(
            {"type": "scene", "integrator": chosen, "still": still, "moved": moved, "light": light, "sensor": sensor},
            optimize=False,
        )

    made, wanted = two_cubes(4.0), rendered(two_cubes(1.1))
    before = rendered(made)
    prepared = made.integrator()._prepared
    assert rendered(made) is not None
    assert made.integrator()._prepared is prepared  # nothing changed
    values = mi.traverse(made)
    values["moved.vertex_positions"] = values["moved.vertex_positions"] - dr.tile(mi.Float(2.9, 0, 0), 24)
    values.update()
    after = rendered(made)
    assert made.integrator()._prepared is not prepared
    np.testing.assert_allclose(after, wanted, rtol=1e-3, atol=1e-4)
    assert np.abs(after - before).max() > 0.05


def test_the_aov_integrator_adds_depth_and_normals(paint):
    chosen = {"type": "aov", "aovs": "d:depth,n:sh_normal", "img": integrator(paint)}
    layers = rendered(scene(chosen))
    np.testing.assert_allclose(layers[..., :4], rendered(scene(integrator(paint))), rtol=1e-5)
    assert layers.shape[-1] == 8
    assert layers[14, 14, 4] == pytest.approx(np.linalg.norm(EYE) - 1, abs=0.1)


def test_one_bake_for_all_leaves_emitters_as_they_are(paint):
    all_of_it = {"type": "rsibr", "bake": paint, "method": METHOD, "occlusion": "off"}
    made = scene(all_of_it)
    lamp = mi.RayDifferential3f(mi.Ray3f([0, 0, 6], [0, 0, -1]))
    red = mi.RayDifferential3f(mi.Ray3f([1.7, 0, 6], [0, 0, -1]))
    np.testing.assert_allclose(np.array(made.integrator().sample(made, sampler(1), lamp)[0]).ravel(), 1, rtol=1e-5)
    wanted = MethodSet(open_bake(paint))[METHOD].eval(mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0, 1))
    np.testing.assert_allclose(
        np.array(made.integrator().sample(made, sampler(1), red)[0]), np.array(wanted), rtol=1e-4
    )


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ({"bake_ball": "absent.rsibr"}, "absent.rsibr: "),
        ({"bake_bal": "paint"}, "no shape 'bal'. Did you mean 'ball'"),
        ({"bake_lamp": "paint"}, "shape 'lamp' is an emitter. Leave out bake_lamp"),
        ({"method": "rsbir"}, "unknown method 'rsbir'. Did you mean 'rsibr'"),
        ({"lookup": "pixl"}, "unknown lookup 'pixl'"),
        ({"occlusion": "maybe"}, "'maybe'. Give one of"),
        ({"nested": {"type": "prb"}}, "takes one nested integrator"),
        ({"nested": {"type": "aov", "aovs": "d:depth"}}, "nest rsibr in it instead"),
        ({"hide_emitters": True, "nested": {"type": "path"}}, "the nested integrator shows emitters"),
        ({"metod": "rsibr"}, 'string "metod"'),
    ],
)
def test_failures_are_said_in_a_line(paint, more, line):
    given = {key: paint if value == "paint" else value for key, value in more.items()}
    with pytest.raises(RuntimeError) as caught:
        rendered(scene(integrator(paint, **given)))
    assert line.lower() in told(caught.value).lower()


def told(error):
    """What the last lines of a traceback say: Mitsuba wraps an error of `mi.render` in one of its own."""
    return f"{error.__cause__} {error}"


def test_a_method_that_does_not_serve_the_bake_is_refused_when_the_scene_is_loaded(tmp_path):
    config = {
        "environment": {"emitter": {"type": "constant"}},
        "material": {"preset": "matte-lambert"},
        "map": {"resolution": 8},
        "sampling": {"samples": 4},
        "effects": {"lobes": "off"},
    }
    path = str(bake(parse_config(config, tmp_path), out=tmp_path / "b.rsibr").path)
    with pytest.raises(RuntimeError, match=r"BakeError: .*its lobes are not stored separately. Bake with"):
        mi.load_dict({"type": "rsibr", "bake": path, "method": "rsibr"})


def test_scalar_and_mono_variants_are_refused(paint):
    for variant in ("scalar_rgb", "llvm_ad_mono"):
        mi.set_variant(variant)
        with pytest.raises(RuntimeError, match=f"the variant {variant} is not supported. Set one of: llvm_ad_rgb"):
            mi.load_dict(integrator(paint))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["spectral", "spectral_polarized"])
def test_spectral_variants_show_the_same_colours(paint, kind):
    wanted = rendered(scene(integrator(paint)), 64)
    mi.set_variant(f"{mi.variant().partition('_ad_')[0]}_ad_{kind}")
    found = rendered(scene(integrator(paint)), 256)
    assert mi.variant().endswith(kind)
    np.testing.assert_allclose(found[10:18, 8:16, :3].mean((0, 1)), wanted[10:18, 8:16, :3].mean((0, 1)), rtol=0.02)


def test_shapes_that_mitsuba_has_merged_are_explained(paint, tmp_path):
    mi.load_dict({"type": "cube"}).write_ply(str(tmp_path / "cube.ply"))
    aside = '<transform name="to_world"><translate x="5"/></transform>'
    ply = '<shape type="ply" id="{}"><string name="filename" value="cube.ply"/><ref id="m"/>{}</shape>'
    shapes = ply.format("ball", "") + ply.format("b", aside)
    nested = (
        f'<integrator type="rsibr"><string name="bake_ball" value="{paint}"/><string name="method" value="{METHOD}"/>'
        '<integrator type="direct"/></integrator>'
    )
    file = tmp_path / "scene.xml"
    text = f'{nested}<bsdf type="diffuse" id="m"/>{shapes}<sensor type="perspective"/>'
    file.write_text(f'<scene version="3.0.0">{text}</scene>')
    with pytest.raises(RuntimeError) as caught:
        mi.render(mi.load_file(str(file)), spp=1)
    assert "load the scene with optimize=False" in told(caught.value)
    small = mi.load_file(str(file), optimize=False)
    ray = mi.RayDifferential3f(mi.Ray3f([0, 0, 5], [0, 0, -1]))
    assert np.array(small.integrator().sample(small, sampler(1), ray)[0]).min() > 0


def test_a_turned_camera_compiles_nothing(paint):
    made = scene(integrator(paint))
    values = mi.traverse(made)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        for turn in range(3):
            values["sensor.to_world"] = mi.Transform4f().look_at([turn, 1, 7], [0, 0, 0], [0, 1, 0])
            values.update()
            dr.kernel_history_clear()
            rendered(made)
            new = [one for one in dr.kernel_history([dr.KernelType.JIT]) if not one["cache_hit"]]
    assert new == []


def test_shapes_beyond_the_table_such_as_those_of_groups_have_no_bake():
    ball = _ball()
    types = SurfaceTypes.assign(ball, ["*"])
    at = first_surfaces(ball.geometry, mi.Ray3f([0, 0, 6], [0, 0, -1]))
    assert types.of(at) == 0
    at.shape += 10**6
    assert types.of(at) == UNBAKED


def test_instances_are_the_nested_integrators(paint):
    group = {"type": "shapegroup", "cube": {"type": "cube"}}
    instance = {"type": "instance", "group": {"type": "ref", "id": "group"}}
    placed = {"group": group, "instance": {**instance, "to_world": mi.ScalarTransform4f().translate([-3, 2, -1])}}
    ray = mi.RayDifferential3f(mi.Ray3f([-3, 2, 6], [0, 0, -1]))
    chosen = ({"type": "rsibr", "bake": paint, "method": METHOD}, {"type": "path"})
    scenes = [scene(one, **placed) for one in chosen]  # alive until the lazy results are evaluated
    found, wanted = (one.integrator().sample(one, sampler(1), ray)[0] for one in scenes)
    np.testing.assert_array_equal(np.array(found), np.array(wanted))


def test_a_rectangle_may_have_a_bake_and_be_occluded(paint):
    floor = {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, -1.2, 0]).rotate([1, 0, 0], -90)}
    made = scene({**integrator(paint), "bake_floor": paint, "occlusion": "on"}, floor=floor)
    assert np.isfinite(rendered(made)).all()


def test_threads_render_what_one_renders_beside_sessions_of_others(paint):
    """Sessions in the same variant: `mi.render` itself reads names of the current one before the integrator's turn."""
    made = [scene(integrator(paint)) for _ in range(2)]
    alone, found = rendered(made[0]), {}
    surfaces = [mi.Vector3f(0, 0, 1)] * 2
    method = MethodSet(open_bake(paint))[METHOD]

    def work(index):
        found[index] = rendered(made[index])

    def other():
        with backend.session():
            found["other"] = np.array(method.eval(*surfaces))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)] + [threading.Thread(target=other)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert found["other"].min() > 0
    for index in range(2):
        np.testing.assert_array_equal(found[index], alone)


def _camera():
    return Camera.look_at(EYE, (0, 0, 0), fov_deg=40, width=SIZE, height=SIZE)


def _ball():
    return ObjectScene("ball", {"ball": mi.load_dict({"type": "sphere"})})

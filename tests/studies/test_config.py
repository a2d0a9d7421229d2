"""The config of a study: what it means, and one line for every mistake; and the plan that follows from it."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest

from rsibr.errors import InputError
from rsibr.resources import configs
from rsibr.studies.agenda import BakeSize, Variant, agenda_of
from rsibr.studies.axes import mesh_of
from rsibr.studies.config import load_study, parse_study

BASE: dict[str, Any] = {
    "environment": {"emitter": {"type": "constant"}},
    "material": {"preset": "matte-lambert"},
    "map": {"resolution": 32},
    "sampling": {"samples": 8},
}


def study(*sweeps: dict[str, Any], **tables: Any):
    return parse_study({"base": deepcopy(BASE), "sweep": list(sweeps or ({},)), **tables})


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({}, "the key 'base' is missing; the key 'sweep' is missing"),
        ({"base": "nowhere.toml", "sweep": [{}]}, "there is no such config"),
        ({"base": 3, "sweep": [{}]}, "base = 3 should be a name, in quotes, or a table"),
        ({"base": BASE, "sweep": []}, "sweep: should hold at least one value"),
        ({"base": BASE, "sweep": {"samples": [4]}}, "sweep: should be a list, in brackets"),
        ({"base": BASE, "sweep": [{"sampels": [4]}]}, "sweep[1]: unknown key 'sampels': did you mean 'samples'?"),
        ({"base": BASE, "sweep": [{}, {"samples": 4}]}, "sweep[2]: samples = 4 should be a list, in brackets"),
        ({"base": BASE, "sweep": [{"samples": [4, 4]}]}, "samples: holds 4 twice"),
        ({"base": BASE, "sweep": [{"samples": [1]}]}, "samples.0 = 1 should be greater than or equal to 4"),
        ({"base": BASE, "sweep": [{"method": ["rsib"]}]}, "is no method: did you mean 'rsibr'?"),
        ({"base": BASE, "sweep": [{"warp": ["mesh-4x2"]}]}, 'should be "texel" or "mesh-RxS"'),
        ({"base": BASE, "sweep": [{"precision": ["float64"]}]}, "should be 'float32' or 'float16'"),
        ({"base": BASE, "sweep": [{}], "judge": {"view": 3}}, "unknown key 'judge.view': did you mean 'judge.views'?"),
        ({"base": BASE, "sweep": [{}], "judge": {"repeats": 1}}, "greater than or equal to 3"),
        ({"base": BASE, "sweep": [{}], "path_tracing": {"samples": [4, 8]}}, "at least three values"),
        ({"base": BASE, "sweep": [{}], "scenes": {"material": [{"prest": "x"}]}}, "did you mean 'material.preset'?"),
        (
            {"base": BASE, "sweep": [{}], "scenes": {"material": ["solid-red", {"preset": "solid-red", "class": 3}]}},
            "scenes.material[2]: class = 3 should be a valid string",
        ),
        ({"base": {**BASE, "smapling": {}}, "sweep": [{}]}, "unknown key 'smapling': did you mean 'sampling'?"),
    ],
)
def test_a_mistake_is_one_clear_line(data, says):
    with pytest.raises(InputError) as refused:
        parse_study(data)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_scenes_are_every_material_under_every_environment():
    scenes = {
        "material": ["solid-red", {"bsdf": {"type": "diffuse"}}],
        "environment": ["sky.exr", {"emitter": {"type": "constant"}, "rotation_deg": 90.0}],
    }
    found = [scene.config for scene in study(scenes=scenes).scenes]
    assert [(c.material.preset, c.environment.file and c.environment.file.name) for c in found] == [
        ("solid-red", "sky.exr"),
        (None, "sky.exr"),
        ("solid-red", None),
        (None, None),
    ]
    assert all(config.map.resolution == 32 for config in found)


def test_a_material_has_a_name_and_a_class():
    material = ["solid-red", {"preset": "solid-red", "warp": "normal", "name": "red", "class": "paint"}]
    plain, named = study(scenes={"material": material}).scenes
    assert (plain.title.name, plain.title.material_class) == (None, None)
    assert (named.title.name, named.title.material_class) == ("red", "paint")
    assert (named.config.material.preset, named.config.material.warp) == ("solid-red", "normal")


def test_without_scenes_the_base_is_the_scene():
    config = study().base
    assert config.material.preset == "matte-lambert"


def test_paths_are_relative_to_the_file_they_stand_in(tmp_path):
    (tmp_path / "base").mkdir()
    base = '[environment]\nfile = "sky.exr"\n[material]\npreset = "solid-red"\n'
    (tmp_path / "base" / "b.toml").write_text(base)
    (tmp_path / "s.toml").write_text('base = "base/b.toml"\n[[sweep]]\nsamples = [4]\n')
    assert load_study(tmp_path / "s.toml").base.environment.file == tmp_path / "base" / "sky.exr"
    text = 'base = "base/b.toml"\n[scenes]\nenvironment = ["sky.exr"]\n[[sweep]]\nsamples = [4]\n'
    (tmp_path / "s.toml").write_text(text)
    assert load_study(tmp_path / "s.toml").base.environment.file == tmp_path / "sky.exr"
    nested = '{bsdf = {type = "twosided", a = {type = "measured", filename = "m.bsdf"}}}'
    (tmp_path / "s.toml").write_text(text.replace("[scenes]", f"[scenes]\nmaterial = [{nested}]"))
    assert load_study(tmp_path / "s.toml").base.material.bsdf["a"]["filename"] == str(tmp_path / "m.bsdf")


def test_the_small_study_that_ships_is_whole():
    settings = load_study(configs() / "study_small.toml")
    assert len(settings.scenes) == 4
    assert all(scene.config.environment.file.is_file() for scene in settings.scenes)
    assert {size.subdivision for size in agenda_of(settings)} == {0, 1}


def test_the_zoo_covers_what_it_says():
    """Each distribution with each α; each metal in both; each material under four skies; every file is there."""
    settings = load_study(configs() / "study_zoo.toml")
    metals = [
        scene.config.material.bsdf
        for scene in settings.scenes
        if (scene.config.material.bsdf or {}).get("type") == "roughconductor"
    ]
    alphas = {0.02, 0.05, 0.1, 0.2, 0.4, 0.6}
    for distribution in ("beckmann", "ggx"):
        own = [bsdf for bsdf in metals if bsdf["distribution"] == distribution]
        assert {bsdf["alpha"] for bsdf in own} == alphas
        assert {bsdf["material"] for bsdf in own} == {"Al", "Au", "Cr", "Cu"}
    assert all(len({bsdf["material"] for bsdf in metals if bsdf["alpha"] == alpha}) == 2 for alpha in alphas)
    names = [scene.title.name or scene.config.material.preset for scene in settings.scenes]
    assert {names.count(name) for name in names} == {4}
    assert all(scene.title.material_class for scene in settings.scenes)
    assert all(scene.config.environment.file.is_file() for scene in settings.scenes)
    assert settings.judge.errors_only
    ((size, variants),) = agenda_of(settings).items()
    assert (size.resolution, size.samples, size.subdivision) == (48, 256, 0)
    assert [variant.method for variant in variants] == ["cabral1999", "rsibr", "rsibr-fine"]


def test_a_plan_holds_every_bake_and_every_picture_once():
    plan = agenda_of(
        study({"samples": [4, 16]}, {"samples": [16], "method": ["rsibr", "blend"], "subdivision": [0, 1]})
    )
    own = [Variant("cabral1999", "texel", "area", "float32"), Variant("rsibr", "texel", "gnomonic", "float32")]
    blend = Variant("blend", "texel", "area", "float32")
    assert plan == {
        BakeSize(4, 32, 0): own,
        BakeSize(16, 32, 0): [*own, blend],
        BakeSize(16, 32, 1): [own[1], blend],
    }


def test_what_means_nothing_is_left_out_of_a_plan():
    (variants,) = agenda_of(
        study({"method": ["nearest", "cabral1999", "rsibr"], "warp": ["texel", "mesh-4x12"], "weights": ["gnomonic"]})
    ).values()
    assert [str(variant) for variant in variants] == [
        "cabral1999, gnomonic weights",
        "cabral1999, mesh-4x12, gnomonic weights",
        "rsibr",
    ]


def test_the_mesh_method_is_the_papers_method_through_its_mesh():
    (variants,) = agenda_of(
        study({"method": ["cabral1999-mesh", "cabral1999"], "warp": ["texel", "mesh-16x48"]})
    ).values()
    assert [str(variant) for variant in variants] == ["cabral1999, mesh-16x48", "cabral1999"]


@pytest.mark.parametrize(
    ("sweep", "base", "says"),
    [
        ({"method": ["nearest"], "warp": ["mesh-4x12"]}, {}, "asks for no picture"),
        ({"subdivision": [1]}, {"views": {"file": "views.json"}}, "views of its own"),
        ({"method": ["rsibr"]}, {"effects": {"lobes": "off"}}, "needs effects.lobes"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(sweep, base, says):
    with pytest.raises(InputError, match=says):
        agenda_of(parse_study({"base": {**BASE, **base}, "sweep": [sweep]}))


def test_views_of_ones_own_have_no_subdivision():
    plan = agenda_of(parse_study({"base": {**BASE, "views": {"file": "views.json"}}, "sweep": [{}]}))
    assert list(plan) == [BakeSize(8, 32, None)]


def test_a_bakes_config_is_the_scenes_but_for_its_size():
    scene = study().base
    config = BakeSize(64, 16, 2).config(scene)
    assert (config.sampling.samples, config.map.resolution, config.views.subdivision) == (64, 16, 2)
    assert (config.material, config.environment, config.sampling.seed) == (scene.material, scene.environment, 0)


def test_names_of_meshes():
    assert (mesh_of("mesh-8x24").rings, mesh_of("mesh-8x24").sectors) == (8, 24)
    assert [mesh_of(name) for name in ("texel", "mesh-0x24", "mesh-8x2", "mesh-8", "mesh-08x24")] == [None] * 5

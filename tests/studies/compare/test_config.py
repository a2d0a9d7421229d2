"""Configs of a comparison: one scene from a bake config, many from a file of scenes."""

from __future__ import annotations

from pathlib import Path

import pytest

from rsibr.errors import InputError
from rsibr.methods.registry import method_names
from rsibr.studies.agenda import agenda_of
from rsibr.studies.compare.config import load_compare, parse_compare
from rsibr.studies.compare.systems import label_of, settings_of, systems_of

BASE = {"environment": {"emitter": {"type": "constant"}}, "material": {"preset": "matte-lambert"}}
ROOT = Path(__file__).parents[3]


def test_a_bake_config_is_one_scene():
    config = load_compare(ROOT / "configs" / "demo.toml")
    (scene,) = config.study.scenes
    assert scene.config.material.preset == "solid-red"
    ((size, _),) = agenda_of(config.study).items()
    assert (size.subdivision, size.resolution, size.samples) == (0, 160, 256)
    assert settings_of(config, None) == list(method_names())


def test_the_shipped_comparison_is_four_skies_and_five_classes():
    config = load_compare(ROOT / "configs" / "compare.toml")
    assert len(config.study.scenes) == 20
    assert len({scene.title.material_class for scene in config.study.scenes}) == 5
    assert [size.subdivision for size in agenda_of(config.study)] == [0, 1]
    assert all(scene.config.environment.file.is_file() for scene in config.study.scenes)


def test_settings_stand_beside_the_methods_that_are_compared():
    config = parse_compare(
        {"base": BASE, "settings": ["cabral1999,weights=gnomonic"], "method": ["blend", "cabral1999"]}
    )
    assert settings_of(config, None) == ["blend", "cabral1999", "cabral1999,weights=gnomonic"]
    assert settings_of(config, ["blend"]) == ["blend"]
    assert systems_of(["rsibr", "cabral1999,weights=area", "cabral1999", "my.own:Method"]) == [
        "cabral1999",
        "rsibr",
        "my.own:Method",
    ]
    assert label_of("rsibr", 12) == "rsibr, 12 views"
    assert label_of("rsibr", None) == "rsibr"


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ({"methods": ["blend"]}, "did you mean 'method'"),
        ({"method": ["blent"]}, "did you mean 'blend'"),
        ({"settings": ["cabral1999,weight=area"]}, "did you mean 'weights'"),
        ({"judge": {"repeats": 3}}, "unknown key 'judge.repeats'"),
        ({"subdivision": [7]}, "subdivision"),
        ({"base": "nowhere.toml"}, "there is no such config"),
    ],
)
def test_mistakes_are_named(tables, says):
    with pytest.raises(InputError, match=says) as error:
        parse_compare(tables, where="mine.toml")
    assert "mine.toml" in error.value.where


def test_views_and_samples_given_replace_those_of_the_config():
    config = parse_compare({"base": BASE, "judge": {"views": 3, "samples": 16}})
    assert (config.judged_with(views=7).study.judge.views, config.study.judge.views) == (7, 3)
    assert config.judged_with(samples=64).study.judge.samples == 64

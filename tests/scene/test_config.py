"""The config: what it accepts, and the one line for each mistake."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rsibr.errors import InputError
from rsibr.scene.config import Config, config_of, load_config, parse_config

MINIMAL = {"environment": {"file": "sky.exr"}, "material": {"preset": "mirror-silver"}}


def parse(*overrides: str, **sections: object) -> Config:
    return parse_config({**MINIMAL, **sections}, Path("/scene"), overrides)


def message(*overrides: str, **sections: object) -> str:
    with pytest.raises(InputError) as caught:
        parse(*overrides, **sections)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_defaults_and_absolute_paths():
    config = parse()
    assert config.environment.file == Path("/scene/sky.exr")
    assert (config.map.resolution, config.sampling.samples, config.views.subdivision) == ("auto", "auto", "auto")
    assert (config.map.side, config.sampling.count, config.views.level) == (256, 1024, 0)
    assert config.sampling.seed == 0
    assert (config.material.warp, config.environment.scale) == ("auto", 1.0)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ('environment.emitter={type="sunsky", turbidity=3}', "views.file=../v.json"),
        ('material.bsdf={type="measured", filename="x.bsdf"}', "sampling.seed=7", "environment.rotation_deg=-90"),
    ],
)
def test_config_survives_its_manifest(overrides):
    config = parse(*overrides)
    assert parse_config(config.to_dict(), Path("/elsewhere")) == config


def test_filename_inside_a_plugin_starts_at_the_config():
    config = parse(material={"bsdf": {"type": "blendbsdf", "a": {"type": "measured", "filename": "m/x.bsdf"}}})
    assert config.material.bsdf is not None
    assert config.material.bsdf["a"]["filename"] == "/scene/m/x.bsdf"


@pytest.mark.parametrize(
    ("sections", "parts"),
    [
        ({"sampling": {"sample": 3}}, ["unknown key 'sampling.sample'", "did you mean 'sampling.samples'?"]),
        ({"smapling": {}}, ["unknown key 'smapling'", "did you mean 'sampling'?"]),
        ({"resolution": 64}, ["unknown key 'resolution'", "did you mean 'map.resolution'?"]),
        ({"map": {"zzz": 1}}, ["unknown key 'map.zzz'", "known here: resolution"]),
        ({"map": {"resolution": True}}, ["map.resolution = true", "integer"]),
        ({"map": {"resolution": 128.0}}, ["map.resolution = 128.0", "integer"]),
        ({"map": {"resolution": 4097}}, ["map.resolution = 4097", "4096"]),
        ({"map": {"resolution": 7}}, ["map.resolution = 7", "8"]),
        ({"sampling": {"samples": 3}}, ["sampling.samples = 3", "4"]),
        ({"sampling": {"seed": -1}}, ["sampling.seed = -1", "0"]),
        ({"views": {"subdivision": 6}}, ["views.subdivision = 6", "5"]),
        ({"views": {"subdivision": 1, "file": "v.json"}}, ["views", "subdivision or file"]),
        ({"map": 3}, ["map should be a table"]),
        ({"environment": {}}, ["environment", "exactly one of file, faces, emitter", "none"]),
        ({"environment": {"file": "a", "emitter": {"type": "constant"}}}, ["given: file, emitter"]),
        ({"environment": {"file": 3}}, ["environment.file = 3", "path"]),
        ({"environment": {"file": "a", "scale": 0.0}}, ["environment.scale = 0.0", "greater than 0"]),
        ({"environment": {"file": "a", "scale": float("inf")}}, ["environment.scale = Infinity", "finite"]),
        ({"environment": {"file": "a", "rotation_deg": float("nan")}}, ["environment.rotation_deg = NaN", "finite"]),
        ({"environment": {"file": "a", "rotation_deg": True}}, ["environment.rotation_deg = true", "number"]),
        ({"environment": {"emitter": {"turbidity": 3}}}, ["environment.emitter", "type"]),
        ({"material": {"preset": "a", "file": "b"}}, ["exactly one of preset, bsdf, file"]),
        ({"material": {"preset": "a", "warp": "mirrored"}}, ["material.warp", "'auto', 'mirror' or 'normal'"]),
        ({"material": {"bsdf": {"type": "diffuse", "reflectance": float("nan")}}}, ["reflectance = nan", "finite"]),
        ({"material": {"bsdf": {"type": "diffuse", "reflectance": {"value": [1]}}}}, ["reflectance.type is missing"]),
    ],
)
def test_a_mistake_is_one_line_with_key_value_and_remedy(sections, parts):
    text = message(**sections)
    assert text.startswith("config: ")
    for part in parts:
        assert part in text


def test_every_mistake_is_named_at_once():
    text = message(map={"resolution": 1}, sampling={"samples": 1})
    assert "map.resolution" in text
    assert "sampling.samples" in text


def test_missing_sections_are_named():
    with pytest.raises(InputError, match=r"'environment' is missing; the key 'material' is missing"):
        parse_config({}, Path())


def test_a_wrong_override_says_that_it_is_one():
    assert "map.resolution = 4 (from --set)" in message("map.resolution=4")


def test_load_reads_relative_to_the_file(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('[environment]\nfile = "../sky.exr"\n[material]\nfile = "m.xml"\n')
    config = load_config(path, ["environment.scale=2"])
    assert config.environment.file == tmp_path.parent / "sky.exr"
    assert config.material.file == tmp_path / "m.xml"
    assert config.environment.scale == 2.0


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"[environment\n", "not valid TOML: Expected ']' at the end of a table declaration (at line 1, column 13)"),
        (b'a = 1\nb = "\xff"\n', "not UTF-8 (byte 11)"),
        (b"[sampling]\nsample = 1\n", "unknown key 'sampling.sample'"),
    ],
)
def test_load_names_the_file(tmp_path, content, part):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_config(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)


def test_load_of_what_is_no_file(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: there is no such config"):
        load_config(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a folder"):
        load_config(tmp_path)


def test_config_is_frozen():
    with pytest.raises(ValueError, match="frozen"):
        parse().sampling.seed = 3  # type: ignore[misc]


@pytest.mark.parametrize("value", ['{type = "x"}', "[1]", "3", "true"])
def test_a_filename_that_is_no_path_is_refused(value, tmp_path):
    with pytest.raises(InputError, match="filename should be a path"):
        parse_config(
            {"material": {"preset": "glossy-plastic"}},
            tmp_path,
            [f'environment.emitter={{type="envmap", filename={value}}}'],
        )


def test_what_is_left_open_stays_open_through_json(tmp_path):
    """`"auto"` and a number are told apart after a round trip; pydantic's record of what was set would not be."""
    tables = {"environment": {"file": "sky.exr"}, "material": {"preset": "glossy-plastic"}}
    given = {"map": {"resolution": 256}, "sampling": {"samples": 1024}, "views": {"subdivision": 0}}
    for keys in ({}, given, {"sampling": {"target_error": 0.01}}, {"budget": {"error": 0.1}}):
        config = parse_config({**tables, **keys}, tmp_path)
        again = parse_config(json.loads(json.dumps(config.to_dict())), tmp_path / "elsewhere")
        assert again == config
        assert again.views.is_open == (config.views.subdivision == "auto") == ("views" not in keys)


@pytest.mark.parametrize("key", ["map.resolution", "sampling.samples", "views.subdivision"])
def test_a_number_may_be_auto_and_no_other_word(tmp_path, key):
    tables = {"environment": {"file": "sky.exr"}, "material": {"preset": "glossy-plastic"}}
    assert parse_config(tables, tmp_path, [f"{key}=auto"]) == parse_config(tables, tmp_path)
    with pytest.raises(InputError, match=rf'{key} = "most" .*whole number.*or "auto"') as refused:
        parse_config(tables, tmp_path, [f'{key}="most"'])
    assert str(refused.value).count(key) == 1


def test_whatever_takes_a_config_takes_a_path_its_tables_and_the_config_itself(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('environment.file = "sky.exr"\nmaterial.preset = "glossy-plastic"\n')
    config = load_config(path)
    for given in (path, str(path), config, config.to_dict()):
        assert config_of(given) == config
        assert config_of(given, ["map.resolution=32"]).map.resolution == 32

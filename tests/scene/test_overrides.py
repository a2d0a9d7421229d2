"""Overrides: values in TOML or bare words, nested keys, and alternatives that replace one another."""

from __future__ import annotations

import pytest

from rsibr.errors import InputError
from rsibr.scene.config import load_config
from rsibr.scene.overrides import apply_overrides, override_keys


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("128", 128),
        ("0.5", 0.5),
        ("true", True),
        ("[1, 2]", [1, 2]),
        ('"a b"', "a b"),
        ("sky.exr", "sky.exr"),
        ("../a=b.exr", "../a=b.exr"),
        ("2024-06-01", "2024-06-01"),
        ("", ""),
        ('{type = "rgb", value = [1, 0, 0]}', {"type": "rgb", "value": [1, 0, 0]}),
    ],
)
def test_value(text, value):
    assert apply_overrides({}, [f"a.b={text}"]) == {"a": {"b": value}}


def test_the_last_override_wins_and_the_input_stays():
    data = {"map": {"resolution": 64}}
    assert apply_overrides(data, ["map.resolution=8", " map.resolution = 16"]) == {"map": {"resolution": 16}}
    assert data == {"map": {"resolution": 64}}


@pytest.mark.parametrize(
    ("data", "override", "expected"),
    [
        ({"environment": {"emitter": {"type": "sunsky"}, "scale": 2}}, "environment.file=a", {"file": "a", "scale": 2}),
        ({"environment": {"file": "a"}}, 'environment.emitter={type="sunsky"}', {"emitter": {"type": "sunsky"}}),
        ({"material": {"file": "a"}}, "material.preset=x", {"preset": "x"}),
        ({"material": {"preset": "x"}}, "material.bsdf.type=diffuse", {"bsdf": {"type": "diffuse"}}),
        ({"material": {"bsdf": {"type": "a", "b": 1}}}, "material.bsdf.b=2", {"bsdf": {"type": "a", "b": 2}}),
        ({"views": {"subdivision": 2}}, "views.file=v.json", {"file": "v.json"}),
        ({"views": {"file": "v.json"}}, "views.subdivision=1", {"subdivision": 1}),
    ],
)
def test_an_alternative_replaces_the_other(data, override, expected):
    section = next(iter(data))
    assert apply_overrides(data, [override]) == {section: expected}


def test_two_alternatives_among_the_overrides_both_stay():
    result = apply_overrides({"material": {"bsdf": {"type": "a"}}}, ["material.preset=x", "material.file=y"])
    assert result == {"material": {"preset": "x", "file": "y"}}


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("map.resolution", "sets nothing"),
        ("=3", "sets nothing"),
        ("map..resolution=3", "sets nothing"),
        ('a.b={type="x"', "not valid TOML"),
        ("a.b=[1, 2", "not valid TOML"),
        ("a.b=1\nc=2", "more than one value"),
        ("map.resolution.x=3", "map.resolution is not a table"),
    ],
)
def test_a_mistake_is_one_line(override, part):
    with pytest.raises(InputError) as caught:
        apply_overrides({"map": {"resolution": 64}}, [override])
    assert part in str(caught.value)
    assert str(caught.value).startswith("overrides: ")
    assert "\n" not in str(caught.value)


def test_override_keys():
    assert override_keys(["a.b=1", "c = x"]) == {"a.b", "c"}


def test_a_path_of_an_override_starts_where_the_user_stands(tmp_path, monkeypatch):
    (tmp_path / "configs").mkdir()
    (tmp_path / "here").mkdir()
    path = tmp_path / "configs" / "c.toml"
    path.write_text('[environment]\nfile = "sky.exr"\n[material]\nfile = "m.xml"\n[plugins]\nmodules = ["p.py"]\n')
    monkeypatch.chdir(tmp_path / "here")
    plain = load_config(path)
    assert plain.environment.file == tmp_path / "configs" / "sky.exr"
    given = load_config(path, ["environment.file=sky.exr", 'plugins.modules=["q.py"]', "views.file='v.json'"])
    assert given.environment.file == tmp_path / "here" / "sky.exr"
    assert given.material.file == tmp_path / "configs" / "m.xml"
    assert given.plugin_modules == (str(tmp_path / "here" / "q.py"),)
    assert given.views.file == tmp_path / "here" / "v.json"
    faces = load_config(path, ["environment.faces=sky_{face}.exr"]).environment.faces
    assert faces is not None
    assert faces["px"] == tmp_path / "here" / "sky_px.exr"
    texture = 'material.bsdf={type = "diffuse", reflectance = {type = "bitmap", filename = "t.png"}}'
    bsdf = load_config(path, [texture]).material.bsdf
    assert bsdf is not None
    assert bsdf["reflectance"]["filename"] == str(tmp_path / "here" / "t.png")
    assert type(bsdf["type"]) is str

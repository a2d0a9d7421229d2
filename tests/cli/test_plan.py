"""`rsibr plan`: a table for people, one documented object for machines, one clear line for mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rsibr.baking.plan_document import PlanDocument, plan_schema
from tests.cli.command import CONFIG, write_config

SWITCHES = (
    "view_dependence",
    *("diffuse", "glossy", "clear_coat", "mirror"),
    *("fresnel", "colour", "light_sampling", "resolution"),
    "lobe_views",
    *("spectral", "polarisation"),
)


def test_the_table_says_what_is_on_and_why(shell, config):
    ended = shell("plan", config, "--set", "effects.view_dependence=auto")
    assert ended.code == 0, ended.stderr
    lines = {line.split()[0]: line for line in ended.stdout.splitlines() if line.split()}
    assert " on " in lines["diffuse"]
    for name in ("view_dependence", "colour", "glossy", "light_sampling"):
        assert " off " in lines[name]
    assert "diffuse: no maps: closed form: under a constant sky" in ended.stdout
    assert "planned: maps of 8², one channel, samples of BSDF" in ended.stdout
    assert "note:" not in ended.stdout


def test_json_is_the_documented_object(shell, config):
    ended = shell("plan", config, "--json")
    assert ended.code == 0, ended.stderr
    document = PlanDocument.model_validate_json(ended.stdout)
    assert ended.json["schema"] == 1
    assert ended.json["missed"] == []
    assert {effect["name"] for effect in ended.json["plan"]["effects"]} >= set(SWITCHES)
    assert document.plan.grey
    for effect in ended.json["plan"]["effects"]:
        assert set(effect) >= {
            "on",
            "forced",
            "evidence",
            "threshold",
            "cost_seconds",
            "saved_bytes",
            "error_if_left_out",
        }


def test_the_documented_schema_is_that_of_the_code():
    documented = Path(__file__).parents[2] / "docs" / "plan.schema.json"
    assert documented.read_text(encoding="utf-8") == plan_schema()
    assert set(json.loads(plan_schema())["required"]) >= {"schema", "missed", "plan"}


SLOW = ("spectral", "polarisation")  # other variants of Mitsuba are compiled for


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in SWITCHES]
)
def test_each_effect_can_be_forced(shell, config, name):
    """On; what is not there is said to be turned on though it hardly matters."""
    found = shell("plan", config, "--set", f"effects.{name}=on", "--json").json["plan"]
    (effect,) = (effect for effect in found["effects"] if effect["name"] == name)
    assert effect["on"]
    assert effect["forced"] == "on"
    assert ("hardly matters here" in effect["why"]) == (effect["evidence"] <= effect["threshold"])


def test_what_is_forced_off_and_matters_is_said(shell, tmp_path):
    config = write_config(tmp_path, CONFIG.replace('preset = "matte-lambert"', 'preset = "glossy-plastic"'))
    ended = shell("plan", config, "--set", "effects.diffuse=off")
    assert "off (as set)" in ended.stdout
    assert "note: diffuse: turned off, though it matters here: " in ended.stdout
    baked = shell("bake", config, "--out", tmp_path / "x.rsibr", "--set", "effects.diffuse=off")
    assert "note: diffuse: turned off, though it matters here: " in baked.stderr


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("effects.difuse=off", "did you mean 'effects.diffuse'"),
        ("effects.diffuse=maybe", "effects.diffuse"),
        ("effects={spectral='off',polarisation='on'}", "polarisation is rendered in spectra only"),
        ("effects.diffuse=off", "nothing is left to bake"),
        ("map.resolution=3", "map.resolution = 3"),
        ("environment.file=gone.exr", "gone.exr"),
    ],
)
@pytest.mark.parametrize("command", ["plan", "bake"])
def test_a_wrong_effect_is_one_line(shell, config, tmp_path, override, says, command):
    out = ["--out", tmp_path / "x"] if command == "bake" else []
    shell.refuses(command, config, *out, "--set", override, "--json", says=says)
    assert not (tmp_path / "x").exists()


def test_lobes_that_are_not_kept_apart_cannot_be_left_out(shell, config):
    shell.refuses("plan", config, "--set", "effects.lobes=off", "--set", "effects.diffuse=off", says="leave lobes")


def test_a_plan_writes_nothing(shell, config, tmp_path):
    shell("plan", config)
    assert list(tmp_path.iterdir()) == [config]

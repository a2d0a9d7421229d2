"""`rsibr compare` as a user types it: winners for people, JSON for machines, one line for a mistake."""

from __future__ import annotations

import json

import pytest

from tests.cli.command import Shell

COMPARISON = """
base = "config.toml"
method = ["nearest"]
[judge]
views = 3
samples = 64
"""


@pytest.fixture
def comparison(config, tmp_path):
    path = tmp_path / "compare.toml"
    path.write_text(COMPARISON)
    return path


def test_a_comparison_prints_winners_and_resumes(shell: Shell, config, comparison, tmp_path):
    out = ("--out", tmp_path / "out", "--views", 1, "--samples", 8, "--method", "nearest")
    ended = shell("compare", config, *out)
    assert ended.code == 0, ended
    assert "matte-lambert (1 scene)\n  time before the first map: nearest, 12 views from" in ended.stdout
    assert "\u00a0" not in ended.stdout
    assert f"report: {tmp_path / 'out' / 'compare.html'}\n" in ended.stdout
    again = shell("compare", comparison, *out, "--json")
    assert again.json == json.loads((tmp_path / "out" / "compare.json").read_text())
    assert again.json["schema"] == 1
    (scene,) = again.json["scenes"]
    assert len(scene["views"]) == 1
    assert scene["reference"]["samples"] == again.json["reference_samples"] == 8


def test_mistakes_are_one_line(shell: Shell, config, comparison, tmp_path):
    out = ("--out", tmp_path / "out")
    shell.refuses("compare", config, says="--out")
    shell.refuses("compare", *out, says="CONFIG")
    shell.refuses("compare", tmp_path / "nowhere.toml", *out, says="there is no such config")
    shell.refuses("compare", config, *out, "--method", "neares", "--json", says="id you mean 'nearest'?")
    shell.refuses("compare", config, *out, "--external", "theirs", says="--external: 'theirs' is no name with a folder")
    shell.refuses("compare", config, *out, "--external", f"nearest={tmp_path}", says="is the name of a method")
    comparison.write_text(COMPARISON.replace("method", "metod"))
    shell.refuses("compare", comparison, *out, says="did you mean 'method'?")
    (tmp_path / "file").write_text("")
    shell.refuses("compare", config, "--out", tmp_path / "file", says="is a file, not a folder")
    shell.refuses("compare", config, *out, "--external", f"t={tmp_path}", "--views", 2, says="--views")

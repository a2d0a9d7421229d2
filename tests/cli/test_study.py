"""`rsibr study` as a user types it: a table for people, JSON for machines, one line for a mistake."""

from __future__ import annotations

import json
import re

import pytest

from tests.cli.command import Shell

STUDY = """
base = "config.toml"
method = ["cabral1999"]
[[sweep]]
samples = [4]
[judge]
views = 1
samples = 16
repeats = 3
[path_tracing]
samples = [4, 16, 64]
pass_samples = 4
"""


@pytest.fixture
def study(config, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


@pytest.mark.slow
def test_a_study_prints_what_it_expects_and_what_it_found(shell: Shell, study, tmp_path):
    ended = shell("study", study, "--out", tmp_path / "out")
    assert ended.code == 0, ended
    assert "expected to take" in ended.stderr
    assert "matte-lambert under constant: Pareto front" in ended.stdout
    assert "gain of doubling the time" in ended.stdout
    assert re.search(r"\nforecast .*, took .*\nreport: ", ended.stdout)
    assert f"report: {tmp_path / 'out' / 'study.html'}\n" in ended.stdout
    assert {"study.html", "study.json", "study.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}
    again = shell("study", study, "--out", tmp_path / "out", "--json")
    assert "already complete" in again.stderr
    assert again.json == json.loads((tmp_path / "out" / "study.json").read_text())
    assert again.json["schema"] == 1


def test_errors_alone_are_printed_by_class(shell: Shell, study, tmp_path):
    """A table for each method, each with its worst pair; names are printed as they are."""
    scenes = '[scenes]\nmaterial = [{preset = "matte-lambert", class = "[red] wall", name = "chalk"}]\n'
    text = STUDY.partition("[path_tracing]")[0].replace('["cabral1999"]', '["cabral1999", "nearest"]')
    study.write_text(text.replace("[[sweep]]", f"{scenes}[[sweep]]") + "errors_only = true\n")
    ended = shell("study", study, "--out", tmp_path / "out")
    assert ended.code == 0, ended
    assert "nearest: relMSE of cabral1999 over its own, geometric mean · least" in ended.stdout
    (row,) = (line for line in ended.stdout.splitlines() if "[red] wall" in line)
    assert "chalk under constant" in row
    assert re.search(r"(inner|middle|rim) · \(0\.\d\d, 0\.\d\d\)", row)
    assert "Pareto" not in ended.stdout
    assert "doubling" not in ended.stdout


def test_mistakes_are_one_line(shell: Shell, study, tmp_path):
    shell.refuses("study", study, says="--out")
    shell.refuses("study", tmp_path / "nowhere.toml", "--out", tmp_path / "out", says="there is no such config")
    study.write_text(STUDY.replace("samples = [4]\n[judge]", "sampels = [4]\n[judge]"))
    shell.refuses("study", study, "--out", tmp_path / "out", says="did you mean 'samples'?")
    shell.refuses("study", study, "--out", tmp_path / "out", "--json", says="sweep[1]")
    study.write_text(STUDY)
    (tmp_path / "file").write_text("")
    shell.refuses("study", study, "--out", tmp_path / "file", says="is a file, not a folder")
    assert not (tmp_path / "out").exists()

"""`rsibr batch`: what it prints, and how it ends."""

from __future__ import annotations

import re

import pytest

from rsibr.batches.config import BatchFile, RunConfig, ThenConfig, ValidateConfig
from rsibr.cli.batch import parse_shard
from rsibr.errors import InputError
from rsibr.resources import configs
from tests.cli.command import write_config
from tests.cli.test_processes import done
from tests.documentation import DOCS, Page

BATCH = """
base = "config.toml"
[matrix]
material = ["matte-lambert", "solid-red"]
"sampling.seed" = [0, 1, 2]
"""


@pytest.fixture
def file(tmp_path):
    write_config(tmp_path)
    path = tmp_path / "batch.toml"
    path.write_text(BATCH)
    return path


def test_a_dry_run_prints_the_forecast(shell, file, tmp_path):
    ended = shell("batch", file, "--dry-run", "--no-probe", "--out", tmp_path / "out")
    assert ended.code == 0
    assert "2 materials, 1 skies, 0 jobs are done already" in ended.stdout
    assert re.search(r"solid-red +│ +12 │ +8 │ +16 │ +3 │", ended.stdout)
    assert re.search(r"6 jobs: \S+ core-hours, .* on this machine .* in \d+ files, .* are free", ended.stdout)
    assert not (tmp_path / "out").exists()


def test_a_dry_run_as_json(shell, file, tmp_path):
    found = shell("batch", file, "--dry-run", "--no-probe", "--json", "--only", "material=solid-red").json
    assert (found["schema"], found["state"], found["jobs"]) == (1, "forecast", 3)
    assert found["forecast"]["kinds"][0]["material"] == "solid-red"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--set", "map.resolutoin=8"], "did you mean 'map.resolution'"),
        (["--set", "sampling.seed=3"], "--set: 'sampling.seed' is set by the matrix"),
        (["--only", "material=gold"], "--only: no job has material=gold"),
        (["--only", "colour=red"], "--only: no job has the key 'colour'"),
        (["--executor", "dusk"], "unknown executor 'dusk'. Did you mean 'dask'?"),
        (["--shard", "3/2"], "--shard: '3/2' is no part of a whole"),
        (["--out", "batch.toml"], "is a file, not a folder"),
    ],
)
def test_a_mistake_is_one_clear_line(shell, file, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    shell.refuses("batch", file, "--dry-run", "--no-probe", *words, says=says)


def test_no_line_is_blank_where_there_is_no_terminal(file, tmp_path):
    code, out, err = done("batch", file, "--only", "material=gold", "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert all(line.strip() for line in err.splitlines())


def test_a_batch_that_is_not_there(shell, tmp_path):
    shell.refuses("batch", tmp_path / "gone.toml", "--json", says="there is no such config")
    shell.refuses("batch", tmp_path / "gone.toml", "--reindex", "--out", tmp_path, says="holds no results of a batch")


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "1/0", "a/2", "-1/2", "1/2/3", "1.0/2", "²/3"])
def test_a_shard_that_is_none(text):
    with pytest.raises(InputError, match="Give I/N"):
        parse_shard(text)


def test_a_shard():
    assert (parse_shard("3/16"), parse_shard(None)) == ((3, 16), None)


def test_the_demo_is_four_materials_under_three_skies(shell, tmp_path):
    found = shell("batch", configs() / "batch_demo.toml", "--dry-run", "--no-probe", "--json", "--out", tmp_path).json
    forecast = found["forecast"]
    assert (found["jobs"], forecast["materials"], forecast["skies"]) == (12, 4, 3)
    assert {kind["resolution"] for kind in forecast["kinds"]} == {64}


def test_the_page_of_batches_has_every_key():
    words = set(re.findall(r"`(\w+)`", Page(DOCS / "how-to" / "batches.md").text))
    for model in (BatchFile, RunConfig, ThenConfig, ValidateConfig):
        assert {field.alias or name for name, field in model.model_fields.items()} - words == set(), model

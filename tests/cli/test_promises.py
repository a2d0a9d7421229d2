"""`rsibr bake` says what it promised and what it reached; `rsibr plan` what it would choose."""

from __future__ import annotations

from tests.cli.command import CONFIG, write_config


def test_a_target_in_words_and_in_json(shell, tmp_path):
    config = write_config(tmp_path, CONFIG.replace("samples = 16", "target_error = 0.01"))
    told = shell("bake", config, "--out", tmp_path / "b.rsibr")
    assert told.code == 0, told.stderr
    assert "noise (relMSE): promised 0.01, reached" in told.stdout
    found = shell("bake", config, "--out", tmp_path / "b.rsibr", "--json").json
    assert found["target_error"]["promised"] == 0.01
    assert found["target_error"]["reached"] == found["noise_rel_mse"] <= 0.01
    assert found["samples"] >= 4


def test_a_time_in_words_and_in_json(shell, tmp_path):
    config = write_config(tmp_path, CONFIG.replace("samples = 16", "time_budget_s = 5"))
    told = shell("bake", config, "--out", tmp_path / "b.rsibr")
    assert told.code == 0, told.stderr
    assert "time: promised 5 s, reached" in told.stdout
    found = shell("bake", config, "--out", tmp_path / "b.rsibr", "--json").json["time_budget_s"]
    assert found["promised"] == 5
    assert found["reached"] > 0


def test_a_budget_in_words_in_json_and_in_the_plan(shell, tmp_path):
    """A budget beats the key of the config that `--set` did not touch: subdivision and samples are open here."""
    config = write_config(tmp_path, CONFIG.replace("samples = 16", "[budget]\nerror = 0.2"))
    planned = shell("plan", config, "--json")
    assert planned.code == 0, planned.stderr
    assert planned.json["budget"]["chosen"]["resolution"] == 8
    told = shell("bake", config, "--out", tmp_path / "b.rsibr")
    assert told.code == 0, told.stderr
    assert "error of a new view (relMSE): promised 0.2, reached" in told.stdout
    found = shell("bake", config, "--out", tmp_path / "b.rsibr", "--json").json["budget"]["error"]
    assert found["promised"] == 0.2
    assert found["reached"] <= 0.2


def test_an_override_takes_the_place_of_its_rival(shell, tmp_path):
    ended = shell("bake", write_config(tmp_path), "--out", tmp_path / "b.rsibr", "--set", "sampling.target_error=0.01")
    assert ended.code == 0, ended.stderr
    assert "promised 0.01" in ended.stdout

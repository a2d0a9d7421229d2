"""`rsibr bake` says what it promised and what it reached; `rsibr plan` what it would choose."""

from __future__ import annotations

from rsibr.budget.promise import Promise
from rsibr.store.manifest import MANIFEST_NAME, read_manifest, write_manifest
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


def with_promises(path, **changes):
    """Put promises that nothing can keep into the manifest of a finished bake, as if they had been asked for."""
    manifest = read_manifest(path / MANIFEST_NAME)
    for name, values in changes.items():
        manifest = manifest.model_copy(update={name: getattr(manifest, name).model_copy(update=values)})
    write_manifest(path / MANIFEST_NAME, manifest)


def test_a_broken_promise_of_noise_or_time_exits_with_1(shell, tmp_path):
    config = write_config(tmp_path, CONFIG.replace("samples = 16", "target_error = 0.01"))
    assert shell("bake", config, "--out", tmp_path / "b.rsibr").code == 0
    with_promises(tmp_path / "b.rsibr", sampling={"promised_rel_mse": -1.0})
    ended = shell("bake", config, "--out", tmp_path / "b.rsibr")
    assert ended.code == 1
    assert "broken promise: sampling.target_error: promised -1, reached" in ended.stderr
    found = shell("bake", config, "--out", tmp_path / "b.rsibr", "--json")
    assert found.code == 1
    assert found.json["target_error"]["kept"] is False
    with_promises(tmp_path / "b.rsibr", sampling={"promised_rel_mse": None, "promised_seconds": 1e-6})
    ended = shell("bake", config, "--out", tmp_path / "b.rsibr")
    assert ended.code == 1
    assert "broken promise: sampling.time_budget_s: promised 1e-06 s, reached" in ended.stderr


def test_a_broken_promise_of_error_exits_with_1_from_bake_and_from_validate(shell, tmp_path):
    config = write_config(tmp_path, CONFIG.replace("samples = 16", "[budget]\nerror = 0.2"))
    bake, report = tmp_path / "b.rsibr", tmp_path / "report"
    judge = ("validate", bake, "--views", "2", "--samples", "16", "--method", "rsibr", "--out", report)
    assert shell("bake", config, "--out", bake).code == 0
    assert shell(*judge).code == 0
    with_promises(bake, budget={"promised_error": -1.0, "reached_error": 1e-3})
    ended = shell("bake", config, "--out", bake)
    assert ended.code == 1
    assert "broken promise: budget.error: promised -1, reached 0.001" in ended.stderr
    ended = shell(*judge)
    assert ended.code == 1
    assert "broken promise: budget.error: promised -1" in ended.stderr
    given = shell("validate", bake, "--view", "1,2,3", "--samples", "16", "--method", "rsibr", "--out", report)
    assert given.code == 0, given.stderr  # one view of the user's choice is no mean over new views


def test_what_was_not_measured_is_not_kept():
    unknown = Promise("budget.seconds", 5.0, None)
    assert not unknown.kept
    assert str(unknown) == "budget.seconds: promised 5 s, not measurable"
    assert Promise("budget.error", 0.1, 0.1).kept
    assert not Promise("budget.error", 0.1, float("nan")).kept

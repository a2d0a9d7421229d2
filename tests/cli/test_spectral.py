"""A bake in spectra from the command line: planned, baked, killed and gone on with, reconstructed and judged."""

from __future__ import annotations

import shutil

import pytest

from rsibr.store.bake import open_bake
from rsibr.store.manifest import read_manifest, write_manifest
from tests.cli.command import write_config

GOLD = """
[environment]
file = "sky.exr"
[material]
bsdf = {type = "roughconductor", material = "Au", distribution = "ggx", alpha = 0.3}
[map]
resolution = 16
[sampling]
samples = 64
"""


@pytest.fixture
def gold(tmp_path, asymmetric_environment):
    shutil.copy(asymmetric_environment, tmp_path / "sky.exr")
    return write_config(tmp_path, GOLD)


def effects_of(document):
    return {effect["name"]: effect for effect in document["plan"]["effects"]}


@pytest.mark.slow
def test_gold_calls_for_spectra_and_its_bake_agrees_with_the_path_tracer(shell, gold, tmp_path):
    found = effects_of(shell("plan", gold, "--json").json)
    assert found["spectral"]["on"]
    assert found["spectral"]["evidence"] > found["spectral"]["threshold"]
    assert found["spectral"]["cost_seconds"] is not None
    assert not found["polarisation"]["on"]
    ended = shell("bake", gold, "--set", "sampling.samples=1024", "--out", tmp_path / "g.rsibr", "--json")
    assert ended.code == 0, ended.stderr
    baked = open_bake(tmp_path / "g.rsibr")
    assert baked.manifest.variant.endswith("_ad_spectral")
    assert baked.rendering == "spectral"
    stored = ",".join(f"{x:.7f}" for x in baked.directions[2])  # where a method shows the map itself
    judged = shell("validate", baked.path, "--view", stored, "--samples", 256, "--out", tmp_path / "v", "--json")
    assert judged.code == 0, judged.stderr
    assert judged.json["summary"]["nearest"]["rel_mse"]["value"] < 0.01
    made = shell("reconstruct", baked.path, "--view", "1,2,3", "--out", tmp_path / "x.exr")
    assert made.code == 0, made.stderr


@pytest.mark.slow
def test_a_spectral_bake_that_was_stopped_ends_bit_identical(shell, gold, tmp_path):
    for name in ("one", "two"):
        assert shell("bake", gold, "--out", tmp_path / f"{name}.rsibr").code == 0
    manifest_file = tmp_path / "two.rsibr" / "manifest.json"
    manifest = read_manifest(manifest_file)
    write_manifest(manifest_file, manifest.with_views(manifest.views[3].pending()))
    (tmp_path / "two.rsibr" / manifest.views[3].file).unlink()
    assert shell("bake", gold, "--out", tmp_path / "two.rsibr").code == 0
    one, two = (open_bake(tmp_path / f"{name}.rsibr").manifest for name in ("one", "two"))
    assert [view.sha256 for view in one.views] == [view.sha256 for view in two.views]
    assert one.light == two.light


def test_spectra_that_are_forced_off_are_missed_and_said(shell, gold, tmp_path):
    ended = shell("bake", gold, "--out", tmp_path / "g.rsibr", "--set", "effects.spectral=off")
    assert ended.code == 0
    assert "note: spectral: turned off, though it matters here: " in ended.stderr
    assert open_bake(tmp_path / "g.rsibr").rendering == "rgb"


@pytest.mark.slow
def test_polarisation_is_rendered_on_request_and_brings_spectra(shell, gold, tmp_path):
    ended = shell("bake", gold, "--out", tmp_path / "p.rsibr", "--set", "effects.polarisation=on")
    assert ended.code == 0, ended.stderr
    baked = open_bake(tmp_path / "p.rsibr")
    assert baked.manifest.variant.endswith("_ad_spectral_polarized")
    assert shell("validate", baked.path, "--views", 1, "--samples", 64, "--out", tmp_path / "v").code == 0


@pytest.mark.slow
def test_a_spectral_bake_of_another_rendering_is_not_gone_on_with(shell, gold, tmp_path):
    assert shell("bake", gold, "--out", tmp_path / "g.rsibr").code == 0
    shell.refuses("bake", gold, "--out", tmp_path / "g.rsibr", "--set", "effects.polarisation=on", says="polarisation")


@pytest.mark.slow
def test_a_budget_of_seconds_times_samples_in_spectra(shell, gold):
    """The rate of the samples is measured in the variant that the bake will have."""
    document = shell("plan", gold, "--json", "--set", "budget.seconds=20").json
    assert effects_of(document)["spectral"]["on"]

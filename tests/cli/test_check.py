"""`rsibr check`: the findings as lines or as one object; exit code 1 if a bake is unusable."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.store.bake import BakeWriter, open_bake
from rsibr.store.manifest import Manifest
from rsibr.validation.health.health_document import HealthModel
from tests.cli.command import write_config


def spoil(path, value):
    """Put `value` into one texel of the last view, as if it had been baked so."""
    bake = open_bake(path)
    maps = [bake.map(index) for index in range(bake.view_count)]
    maps[-1].layers["radiance"][4, 3, 0] = value
    fresh = bake.manifest.with_views(*(state.pending() for state in bake.manifest.views))
    with BakeWriter.open(path, Manifest.model_validate(fresh.model_dump()), fresh=True) as writer:
        for index, map_file in enumerate(maps):
            writer.commit(index, map_file, 0.25)


def test_a_sound_bake_ends_with_0(shell, baked):
    ended = shell("check", baked)
    assert ended.code == 0
    assert "nothing found (12 views" in ended.stdout
    assert ended.stderr == ""


def test_nan_ends_with_1_and_is_named_with_its_place(shell, baked, tmp_path):
    spoil(baked, np.nan)
    ended = shell("check", baked, "--out", tmp_path / "report")
    assert ended.code == 1
    assert "unusable" in ended.stdout
    assert "view 11, row 4, column 3 (s 0.4375, t 0.4375)" in ended.stdout
    assert (tmp_path / "report" / "health.html").exists()


def test_json_is_one_object_whatever_is_found(shell, baked):
    sound = HealthModel.model_validate(shell("check", baked, "--json").json)
    assert sound.trusted
    assert {finding.verdict for finding in sound.findings.values()} == {"none"}
    spoil(baked, np.inf)
    ended = shell("check", baked, "--json")
    assert ended.code == 1
    told = HealthModel.model_validate(ended.json)
    assert not told.trusted
    assert told.findings["non_finite"].texels == 1
    assert told.findings["non_finite"].verdict == "failed"


def test_an_overflow_is_a_warning(shell, baked):
    spoil(baked, 1e5)
    ended = shell("check", baked)
    assert ended.code == 0
    assert "warning: 1 texel in 1 view: half-overflow (above 65504" in ended.stdout


def test_bake_says_what_it_found_and_check_that_it_was_clamped(shell, tmp_path):
    config = write_config(tmp_path)
    out = tmp_path / "b.rsibr"
    assert shell("bake", config, "--out", out, "--clamp", "0.3").code == 0
    assert open_bake(out).config["sampling"]["clamp"] == 0.3
    ended = shell("check", out)
    assert ended.code == 0
    assert "samples above 0.3 were clamped" in ended.stdout
    shell.refuses("bake", config, "--out", out, says="sampling.clamp: 0.3 → absent")


@pytest.mark.parametrize("value", ["0", "nan", "-1"])
def test_a_clamp_that_is_none_is_refused(shell, tmp_path, value):
    shell.refuses("bake", write_config(tmp_path), f"--clamp={value}", says="sampling.clamp")


def test_what_is_no_bake_is_refused(shell, tmp_path):
    shell.refuses("check", tmp_path / "none.rsibr", says="does not exist")
    (tmp_path / "file").write_text("")
    shell.refuses("check", tmp_path, "--out", tmp_path / "file", says="is a file")
